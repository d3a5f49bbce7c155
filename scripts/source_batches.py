#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes batches: translation units that each compile several sources, one after the other.

Most of what a compiler does for a source it does for the headers that the source includes. Sources
that are compiled alike can share that work. CMake's UNITY_BUILD does the same, but requires that no two
sources of a target use a file-local name for different things. Here, a batch includes the headers of
all its sources first. Then each source follows, and #define gives its file-local names (those in
unnamed namespaces) another spelling where a neighbour uses them, too. A name that the source also
uses as a member or as a name of another namespace cannot be renamed like that: then the two sources
are in different batches. All of this is decided from the text of the sources.

    scripts/source_batches.py FOLDER <LISTS >COMMANDS

reads lines "TARGET;LONGEST;SOURCE_FOLDER;SOURCE;SOURCE...", writes the batches to FOLDER, each of at
most LONGEST sources, and prints CMake commands that replace the sources by them. The build asks so.
"""

import functools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]

# Declarations that begin in a line's first column, which is where clang-format puts those of a
# namespace.
DECLARATION = re.compile(
    r"(?:template\b.*>\s*)?(?:struct|class|union|enum(?: class)?)\s+(?:alignas\([^)]*\)\s*)?(\w+)"
    r"\s*(?:final\s*)?(?:[:{;]|$)"
    r"|using\s+(\w+)\s*="
    r"|(?!using|static_assert)[A-Za-z_][\w:<>(),\s*&\[\]]*?\b([a-z_]\w*)\s*[(={\[;]")
# What GoogleTest makes a test's name from; it must not depend on batches.
TEST_NAME = re.compile(r"\b(?:TEST(?:_F|_P)?|TYPED_TEST(?:_SUITE)?|INSTANTIATE_TEST_SUITE_P)"
                       r"\(\s*(\w+)\s*,\s*(\w+)")
# Functions and objects that are called or initialised; types and constants. No other name of a
# namespace occurs without its namespace.
USE = re.compile(r"(?<!\.)(?<!->)(?<!::)\b(?:([a-z_]\w*)\s*[(<{]|(k?[A-Z]\w*))")


class File:
    """The names in a source or a header.

    own: those in unnamed namespaces; declared: these, all others of namespaces, and macros; used: those
    that may mean a name of a namespace; fixed: those that also name a member, a test or a name of
    another namespace; includes: the lines that include headers unconditionally; headers: those of the
    project.
    """

    def __init__(self, path):
        text = path.read_text(encoding="utf-8")
        # A file may name the headers beside it by name only.
        text = re.sub(r'#include "([^/"]+)"', lambda found: f'#include "{path.parent}/{found[1]}"', text)
        self.macros = set(re.findall(r"^#define\s+(\w+)", text, re.MULTILINE))
        self.own, self.declared, self.includes = set(), set(self.macros), []
        depth, unnamed, of_c = 0, False, False
        for line in text.splitlines():
            if line in ("namespace {", "}  // namespace"):
                unnamed = line.endswith("{")
            elif line in ('extern "C" {', "}"):
                of_c = line != "}"
            elif line.startswith("#"):
                depth += line.startswith("#if") - line.startswith("#endif")
                if line.startswith("#include") and depth == 0:
                    self.includes.append(f'extern "C" {{\n{line}\n}}' if of_c else line)
            elif not line.startswith("namespace") and (found := DECLARATION.match(line)):
                self.declared.add(found[found.lastindex])
                if unnamed:
                    self.own.add(found[found.lastindex])
        headers = (ROOT / name for name in re.findall(r'#include "([^"]+)"', text))
        self.headers = [header for header in headers if header.exists()]
        code = re.sub(r'"(?:\\.|[^"\\\n])*"|#include.*|//.*', "", text)
        self.words = set(re.findall(r"\b(?!k[A-Z])[a-z_]\w*", code))
        self.used = self.own.union(*USE.findall(code), re.findall(r"^using [\w:]+::(\w+);", code, re.MULTILINE))
        self.fixed = self.macros.union(re.findall(r"(?:\.|->|::)\s*~?([A-Za-z_]\w*)", code),
                                       *TEST_NAME.findall(code))


file_at = functools.cache(File)


@functools.cache
def headers_of(path):
    """Returns the project's headers that a source includes, and those that they include."""
    headers, waiting = set(), [path]
    while waiting:
        new = set(file_at(waiting.pop()).headers) - headers
        headers |= new
        waiting += new
    return [file_at(header) for header in sorted(headers)]


@functools.cache
def mentioned_by(path):
    return file_at(path).used.union(file_at(path).macros, *(header.declared for header in headers_of(path)))


@functools.cache
def renamable(path):
    """Returns the file-local names that can have another spelling: a header's word may be a member."""
    return file_at(path).own - file_at(path).fixed.union(*(header.words | header.declared for header in headers_of(path)))


def clash(one, other):
    """Tells whether one keeps a name to itself that the other mentions, and that cannot be renamed."""
    stubborn = (file_at(one).own | file_at(one).macros) - renamable(one)
    return not stubborn.isdisjoint(mentioned_by(other) - renamable(other))


def batches_of(paths, longest):
    """Distributes the paths over few lists of about equal length."""
    most = 1.1 * sum(path.stat().st_size for path in paths) / -(-len(paths) // longest)
    clashes = {one: {other for other in paths if other != one and (clash(one, other) or clash(other, one))}
               for one in paths}
    batches = []
    for path in sorted(paths, key=lambda path: (-len(clashes[path]), path)):
        homes = (batch for batch in batches if clashes[path].isdisjoint(batch)
                 and sum(other.stat().st_size for other in [path, *batch]) <= most)
        if home := next(homes, None):
            home.append(path)
        else:
            batches.append([path])
    return [sorted(batch) for batch in batches]


def text_of(batch):
    lines = ["// Written by scripts/source_batches.py.",
             *dict.fromkeys(line for path in batch for line in file_at(path).includes)]
    for path in batch:
        suffix = re.sub(r"\W", "_", str(path.relative_to(ROOT).with_suffix("")))
        elsewhere = set().union(*(mentioned_by(other) for other in batch if other != path))
        names = sorted(renamable(path) & elsewhere)
        lines += [*(f"#define {name} {name}_of_{suffix}" for name in names), f'#include "{path}"',
                  *(f"#undef {name}" for name in names + sorted(file_at(path).macros))]
    return "\n".join(lines) + "\n"


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for line in sys.stdin:
        target, longest, source_folder, *sources = line.rstrip("\n").split(";")
        paths = {source: pathlib.Path(source_folder, source).resolve() for source in sources
                 if source.endswith(".cpp") and not source.startswith(str(folder.parent))}
        sources = [source for source in sources if source not in paths]
        for number, batch in enumerate(batches_of(list(paths.values()), int(longest)) if paths else []):
            if len(batch) == 1:
                sources += map(str, batch)
                continue
            file = folder / f"{target}_{number}.cpp"
            sources.append(str(file))
            text = text_of(batch)
            if not file.exists() or file.read_text(encoding="utf-8") != text:
                file.write_text(text, encoding="utf-8")
        print(f"set_property(TARGET {target} PROPERTY SOURCES [[{';'.join(sources)}]])")


if __name__ == "__main__":
    main()
