#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes batches: translation units that each compile several sources, one after the other.

Most of what a compiler does for a source it does for the headers that the source includes. Sources
that are compiled alike can share that work. A batch includes the headers of all its sources first.
Then each source follows. A name that a source keeps to itself, in an unnamed namespace, and that
means something else in another source of the batch gets another name for the length of that source,
by #define. Where that could rename something else as well, the source follows those that use the name
otherwise, or is in another batch. All of this is decided from the text of the sources.

    scripts/source_batches.py FOLDER <LISTS >GROUPS

reads lines "TARGET;LONGEST;SOURCE;SOURCE...", writes the batches to FOLDER, each of at most LONGEST
sources, and answers with lines "TARGET|BATCH|SOURCE" for the sources that are in a batch with others.
The build asks so.
"""

import dataclasses
import functools
import graphlib
import itertools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]

# Declarations that begin in a line's first column, which is where clang-format puts those of a
# namespace.
DECLARATIONS = [re.compile(pattern) for pattern in (
    r"(?:template\b.*>\s*)?(?:struct|class|union|enum(?: class)?)\s+(?:alignas\([^)]*\)\s*)?(\w+)"
    r"\s*(?:final\s*)?(?:[:{;]|$)",
    r"using\s+(\w+)\s*=",
    r"(?!using|static_assert)[A-Za-z_][\w:<>,\s*&\[\]]*?\b(\w+)\s*[(={\[;]")]

# What GoogleTest makes a test's name from; it must not depend on batches.
TEST_NAME = re.compile(r"\b(?:TEST(?:_F|_P)?|TYPED_TEST(?:_SUITE)?|INSTANTIATE_TEST_SUITE_P)"
                       r"\(\s*(\w+)\s*,\s*(\w+)")


@dataclasses.dataclass
class Names:
    """What a file declares for everybody, what it keeps in unnamed namespaces, and its words.

    aliases: the names that it takes over from other namespaces, outside unnamed ones.
    fixed: the words that must keep their spelling in this file, because they also name members, names
    of other namespaces or tests.
    directives: the lines that include headers unconditionally; includes: the project's own headers.
    """
    public: set
    own: set
    aliases: set
    macros: set
    words: set
    fixed: set
    directives: list
    includes: list


def from_root(path, name):
    """A line that includes a header from any folder; a file may name those beside it by name only."""
    beside = path.parent / name
    return f'#include "{beside.relative_to(ROOT) if beside.exists() else name}"'


@functools.cache
def names_in(path):
    text = path.read_text(encoding="utf-8")
    text = re.sub(r'#include "([^"]+)"', lambda found: from_root(path, found.group(1)), text)
    includes = [ROOT / name for name in re.findall(r'#include "([^"]+)"', text)]
    public, own = set(), set()
    into = public
    macros = set(re.findall(r"^#define\s+(\w+)", text, re.MULTILINE))
    code = re.sub(r'"(?:\\.|[^"\\\n])*"', '""', text)
    directives, depth, of_c = [], 0, False
    for line, original in zip(code.splitlines(), text.splitlines()):
        if line == "namespace {":
            into = own
        elif line == "}  // namespace":
            into = public
        elif line.startswith("#"):
            depth += line.startswith("#if") - line.startswith("#endif")
            if line.startswith("#include") and depth == 0:
                directives.append(f'extern "C" {{\n{original}\n}}' if of_c else original)
        elif line in ('extern "" {', "}"):
            of_c = line != "}"
        elif not line.startswith("namespace"):
            found = next(filter(None, (kind.match(line) for kind in DECLARATIONS)), None)
            if found:
                into.add(found.group(1))
    code = re.sub(r"#include.*|//.*", "", code)
    words = set(re.findall(r"(?<!\.)(?<!->)(?<!::)\b[A-Za-z_]\w*", code))
    fixed = set(re.findall(r"(?:\.|->|::)\s*~?([A-Za-z_]\w*)", code))
    fixed.update(word for names in TEST_NAME.findall(code) for word in names)
    aliases = set(re.findall(r"^using [\w:]+::(\w+);", code, re.MULTILINE))
    return Names(public, own, aliases, macros, words, fixed, directives,
                 [path for path in includes if path.exists()])


@functools.cache
def headers_of(path):
    """The project's headers that a source includes, and those that they include."""
    headers, waiting = set(), list(names_in(path).includes)
    while waiting:
        header = waiting.pop()
        if header not in headers:
            headers.add(header)
            waiting += names_in(header).includes
    return headers


@functools.cache
def declared_to(path):
    """The names that the project's headers declare to a source."""
    return set().union(*(names_in(header).public | names_in(header).own | names_in(header).macros
                         for header in headers_of(path)))


@functools.cache
def mentioned_by(path):
    return names_in(path).words | names_in(path).aliases | declared_to(path)


@functools.cache
def renamable(path):
    """The names that a source keeps to itself and that mean nothing else in its text or headers."""
    names = names_in(path)
    return names.own - names.fixed - names.macros - {
        word for header in headers_of(path) for word in names_in(header).words}


def stubborn(one, other):
    """The names that one keeps to itself, that the other mentions, and that cannot be renamed."""
    return ((names_in(one).own - renamable(one)) & mentioned_by(other)) - (
        names_in(other).own & renamable(other))


def neighbours_of(paths):
    """For each path those that cannot be in its batch, and those that must precede it in a batch."""
    clashes = {path: set() for path in paths}
    before = {path: set() for path in paths}
    for one, other in itertools.permutations(paths, 2):
        names = stubborn(one, other)
        if not names:
            continue
        if names.isdisjoint(names_in(other).own | names_in(other).aliases
                            | (declared_to(other) - declared_to(one))):
            before[one].add(other)
        else:
            clashes[one].add(other)
            clashes[other].add(one)
    return clashes, before


def in_order(batch, before):
    """The sources, those that use a name otherwise before the one that keeps it; None in a circle."""
    graph = {path: sorted(before[path].intersection(batch)) for path in sorted(batch)}
    try:
        return list(graphlib.TopologicalSorter(graph).static_order())
    except graphlib.CycleError:
        return None


def renamed(path, batch):
    """The names of a source that need another name in a batch."""
    return sorted(name for name in renamable(path)
                  if any(name in mentioned_by(other) for other in batch if other != path))


def preamble(batch):
    """The lines that include the headers of all sources, each once: no new name may reach them."""
    once = dict.fromkeys(line for path in batch for line in names_in(path).directives)
    return "\n".join(once).splitlines()


def before_and_after(path, batch):
    """The lines that give a source its own names, and those that end that."""
    suffix = re.sub(r"\W", "_", str(path.relative_to(ROOT).with_suffix("")))
    names = renamed(path, batch)
    return ([f"#define {name} {name}_of_{suffix}" for name in names],
            [f"#undef {name}" for name in names + sorted(names_in(path).macros)])


def length_of(path):
    return path.stat().st_size


@functools.cache
def libraries_of(path):
    """The headers of libraries that a source includes, also through the project's headers."""
    lines = set(names_in(path).directives).union(
        *(names_in(header).directives for header in headers_of(path)))
    found = (re.search(r"<.*(?:/|\.h).*>", line) for line in lines)
    return frozenset(name.group() for name in found if name)


def batches_of(paths, longest):
    """The paths in few lists of about equal length, so that who shares a list shares headers."""
    count = -(-len(paths) // longest)
    most = 1.1 * sum(map(length_of, paths)) / count
    clashes, before = neighbours_of(paths)
    batches = []
    for path in sorted(paths, key=lambda path: (sorted(libraries_of(path)), path)):
        homes = [batch for batch in batches if clashes[path].isdisjoint(batch)
                 and sum(map(length_of, batch)) + length_of(path) <= most
                 and in_order([*batch, path], before)]
        if not homes:
            batches.append([])
            homes = batches[-1:]
        min(homes, key=lambda batch: len(
            libraries_of(path).difference(*map(libraries_of, batch)))).append(path)
    return [in_order(batch, before) for batch in batches]


def text_of(batch):
    """A translation unit of a batch's sources."""
    lines = ["// Written by scripts/source_batches.py.", *preamble(batch)]
    for path in batch:
        before, after = before_and_after(path, batch)
        lines += [*before, f'#include "{path}"', *after]
    return "\n".join(lines) + "\n"


def write_if_changed(path, text):
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for line in sys.stdin:
        target, longest, *sources = line.rstrip("\n").split(";")
        paths = [pathlib.Path(source) for source in sources]
        for number, batch in enumerate(batches_of(paths, int(longest))):
            if len(batch) > 1:
                file = folder / f"{target}_{number}.cpp"
                write_if_changed(file, text_of(batch))
                for path in batch:
                    print(f"{target}|{file}|{path}")


if __name__ == "__main__":
    main()
