# SPDX-License-Identifier: Apache-2.0
"""Fails where a page has a link that leads nowhere, is too long, or has a picture that is too large.

Usage: check_docs.py SOURCE_DIR

Pages are README.md, CONTRIBUTING.md and docs/**/*.md. Checked are relative links with their headings,
rows of tables with too many or too few cells, and pages' lengths (docs/measurements/ has no limit).
Pictures are docs/pictures/*; a page shows each, and a script scripts/make-* names each PNG that it makes.
"""

import pathlib
import re
import sys

MOST_LINES = 250
MOST_PICTURE_BYTES = 550_000
MOST_PICTURES_BYTES = 4_000_000

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def text_lines(path):
    """(number, line) outside of code blocks, inline code blanked."""
    fenced = False
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.startswith("```"):
            fenced = not fenced
        elif not fenced and not line.startswith("    "):
            yield number, line


def anchors(path):
    """The names that links can use for a page's headings, as GitHub forms them."""
    found = set()
    for _, line in text_lines(path):
        if heading := re.match(r"#+ +(.*)", line):
            words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.group(1)).lower()
            name = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
            while name in found:
                name += "-1"
            found.add(name)
    return found


def wrong_links(path, used):
    """Complaints about links; adds every linked file to `used`."""
    for number, line in text_lines(path):
        for target in LINK.findall(re.sub(r"`[^`]*`", "", line)):
            if re.match(r"\w+:", target):
                continue
            name, _, heading = target.partition("#")
            file = (path.parent / name).resolve() if name else path
            used.add(file)
            if not file.exists():
                yield f"{number}: link to {target}: no such file"
            elif heading and heading not in anchors(file):
                yield f"{number}: link to {target}: no such heading"


def wrong_tables(path):
    """Complaints about rows that have another number of cells than their table's head."""
    cells = None
    for number, line in text_lines(path):
        if not line.startswith("|"):
            cells = None
            continue
        count = len(re.findall(r"(?<!\\)\|", line)) - 1
        cells = cells or count
        if count != cells:
            yield f"{number}: {count} cells in a table of {cells}"


def wrong_pictures(source, used):
    """Complaints about the files in docs/pictures."""
    scripts = "".join(path.read_text() for path in (source / "scripts").glob("make-*"))
    total = 0
    for path in sorted((source / "docs" / "pictures").glob("*")):
        size = path.stat().st_size
        total += size
        name = path.relative_to(source)
        if path.suffix not in (".png", ".svg", ".webp"):
            yield f"{name}: neither PNG, SVG nor WebP"
        if size > MOST_PICTURE_BYTES:
            yield f"{name}: {size} bytes, at most {MOST_PICTURE_BYTES} are allowed"
        if path.resolve() not in used:
            yield f"{name}: no page shows it"
        if path.suffix != ".svg" and path.name not in scripts:
            yield f"{name}: no script scripts/make-* makes it"
    if total > MOST_PICTURES_BYTES:
        yield f"docs/pictures: {total} bytes, at most {MOST_PICTURES_BYTES} are allowed"


def main():
    source = pathlib.Path(sys.argv[1]).resolve()
    pages = [source / "README.md", source / "CONTRIBUTING.md", *sorted((source / "docs").rglob("*.md"))]
    used, wrong = set(), []
    for page in filter(pathlib.Path.exists, pages):
        name = page.relative_to(source)
        wrong += [f"{name}:{text}" for text in (*wrong_links(page, used), *wrong_tables(page))]
        lines = len(page.read_text().splitlines())
        if lines > MOST_LINES and "measurements" not in name.parts:
            wrong.append(f"{name}: {lines} lines, at most {MOST_LINES} are allowed")
    wrong += wrong_pictures(source, used)
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{len(pages)} pages: every link leads somewhere")


main()
