# SPDX-License-Identifier: Apache-2.0
"""Fails where a page of docs/, or a SLOW filter of a test program, names a test that does not exist.

Usage: check_named_tests.py SOURCE_DIR

Names of tests, in backticks: Suite.Name or Instances/Suite.Name of GoogleTest, .Name of
the suite named before it, test_FILE.NAME of tests/vm, fuzz.replay.NAME, and scripts/NAME.
"""

import pathlib
import re
import sys

DECLARED = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\s*\)")
TYPED = re.compile(r"\bTYPED_TEST(?:_P)?\(\s*(\w+),\s*(\w+)\s*\)")
VM_TEST = re.compile(r"@vm_test\([^@]*?\)\ndef (\w+)\(")
SLOW = re.compile(r'\bSLOW "([^"]+)"')
GOOGLE = re.compile(r"(?:\w+/)?([A-Z]\w*)\.([A-Z]\w+)")


def existing(source):
    """Returns the names of all tests in the tree."""
    names = set()
    for path in (source / "tests").rglob("*.cpp"):
        text = path.read_text()
        for found in (*DECLARED.finditer(text), *TYPED.finditer(text)):
            names.add(".".join(found.groups()))
    for path in (source / "tests" / "vm").glob("test_*.py"):
        names |= {f"{path.stem}.{name}" for name in VM_TEST.findall(path.read_text())}
    names |= {f"fuzz.replay.{path.stem.removesuffix('_fuzz')}" for path in (source / "tests" / "fuzz").rglob("*_fuzz.cpp")}
    names |= {f"scripts/{path.name}" for path in (source / "scripts").glob("*")}
    return names


def named(text):
    """Yields (line number, name) for every test that a page names."""
    suite = ""
    for number, line in enumerate(text.splitlines(), 1):
        for word in re.findall(r"`([^`]+)`", line):
            if found := GOOGLE.fullmatch(word):
                suite = found.group(1)
                yield number, f"{suite}.{found.group(2)}"
            elif re.fullmatch(r"\.[A-Z]\w+", word):
                yield number, suite + word
            elif re.fullmatch(r"test_\w+\.(?!py$)\w+|fuzz\.replay\.[a-z]\w*|scripts/[\w-]+", word):
                yield number, word


def slow_filters(source):
    """(CMake file, Suite or Suite.Name) of every case that a test program calls slow."""
    for path in sorted((source / "tests").rglob("CMakeLists.txt")):
        for patterns in SLOW.findall(path.read_text()):
            for pattern in patterns.split(":"):
                # Instances/Suite.Name/parameter
                case = next(part for part in pattern.split("/") if "." in part)
                yield path, case.removesuffix(".*")


def main():
    source = pathlib.Path(sys.argv[1])
    there = existing(source)
    wrong = [f"{path.relative_to(source)}:{number}: no test {name}"
             for path in sorted((source / "docs").rglob("*.md"))
             for number, name in named(path.read_text()) if name not in there]
    suites = {name.partition(".")[0] for name in there}
    wrong += [f"{path.relative_to(source)}: no slow test {name}"
              for path, name in slow_filters(source) if name not in there | suites]
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"every named test exists, of {len(there)}")


main()
