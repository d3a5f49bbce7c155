#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Which sources can be compiled together, as one translation unit.

Most of what a compiler does for a source it does for the headers that the source includes. Sources
that are compiled alike can share that work: one after the other in one translation unit. Two
sources cannot where a name that one keeps to itself (in an unnamed namespace, or by #define) means
something else in the other. That is guessed from their text.

    scripts/source_batches.py LONGEST <LISTS >GROUPS

reads lines "TARGET;SOURCE;SOURCE..." and answers with lines "TARGET|BATCH|SOURCE", for the sources
that are in a batch with others; LONGEST is the most sources of a batch. The build asks so.
"""

import dataclasses
import functools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]

# Declarations that begin in a line's first column, which is where clang-format puts those of a
# namespace.
DECLARATIONS = [re.compile(pattern) for pattern in (
    r"(?:template\b.*>\s*)?(?:struct|class|union|enum(?: class)?)\s+(?:alignas\([^)]*\)\s*)?(\w+)",
    r"using\s+(\w+)\s*=",
    r"(?!using|static_assert)[A-Za-z_][\w:<>,\s*&\[\]]*?\b(\w+)\s*[(={\[;]")]


@dataclasses.dataclass
class Names:
    """What a file declares for everybody, what it keeps in unnamed namespaces, all its words."""
    public: set
    own: set
    words: set
    includes: list


@functools.cache
def names_in(path):
    text = path.read_text(encoding="utf-8")
    includes = [ROOT / name for name in re.findall(r'#include "([^"]+)"', text)]
    public, own = set(), set()
    into = public
    own.update(re.findall(r"^#define\s+(\w+)", text, re.MULTILINE))
    code = re.sub(r'"(?:\\.|[^"\\\n])*"', '""', text)
    for line in code.splitlines():
        if line == "namespace {":
            into = own
        elif line == "}  // namespace":
            into = public
        elif not line.startswith("namespace"):
            found = next(filter(None, (kind.match(line) for kind in DECLARATIONS)), None)
            if found:
                into.add(found.group(1))
    words = set(re.findall(r"[A-Za-z_]\w*", re.sub(r"#include.*|//.*", "", code)))
    return Names(public, own, words, [path for path in includes if path.exists()])


@functools.cache
def mentioned_by(path):
    """The words of a source and the names that the project's headers declare to it."""
    headers, waiting = set(), list(names_in(path).includes)
    while waiting:
        header = waiting.pop()
        if header not in headers:
            headers.add(header)
            waiting += names_in(header).includes
    return names_in(path).words.union(
        *(names_in(header).public | names_in(header).own for header in headers))


def may_clash(one, other):
    return (not names_in(one).own.isdisjoint(mentioned_by(other))
            or not names_in(other).own.isdisjoint(mentioned_by(one)))


def batches_of(paths, longest):
    """The paths in as few lists as a greedy colouring finds: who clashes most chooses first."""
    paths = sorted(paths)
    clashes = {path: {other for other in paths if other != path and may_clash(path, other)}
               for path in paths}
    batches = []
    for path in sorted(paths, key=lambda path: -len(clashes[path])):
        home = next((batch for batch in batches if len(batch) < longest
                     and clashes[path].isdisjoint(batch)), None)
        if home is None:
            batches.append([path])
        else:
            home.append(path)
    return batches


def main():
    if len(sys.argv) != 2 or not sys.argv[1].isdigit():
        sys.exit(__doc__)
    for line in sys.stdin:
        target, *sources = line.rstrip("\n").split(";")
        paths = [pathlib.Path(source) for source in sources]
        for number, batch in enumerate(batches_of(paths, int(sys.argv[1]))):
            if len(batch) > 1:
                for path in sorted(batch):
                    print(f"{target}|{target}_{number}|{path}")


if __name__ == "__main__":
    main()
