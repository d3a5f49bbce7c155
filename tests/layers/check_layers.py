#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the structure of the sources.

    tests/layers/check_layers.py TREE

Fails with a list of the places where
- a module includes one that docs/architecture.md does not allow it to include, or names a library
  that belongs to another module,
- sub-folders of a module include each other in a cycle,
- a folder, also one of tests, holds more than MOST_FILES sources,
- a source prints without base/print.h,
- a kernel for one instruction set is named outside of base/cpu.h, which asks the processor,
- the preprocessor is asked for the version of a library outside of that library's one header.
"""

import collections
import pathlib
import re
import sys

MOST_FILES = 42

# module: the modules that it may include, beside itself
MAY_INCLUDE = {
    "base": "",
    "optics": "base",
    "frames": "base optics",
    "scenes": "base optics",
    "render": "base optics frames",
    "display": "base optics frames",
    "calib": "base optics frames",
    "player": "base optics frames display",
    "farm": "base optics frames",
    "apps/lenticule-video": "base optics frames",
    "apps/lenticule-pictures": "base optics frames apps/lenticule-video",
    "apps/lenticule-reader": "base optics frames render apps/lenticule-video",
    "apps/lenticule-web": "base optics frames",
    "apps/lenticule-window": "base optics frames",
    "apps/lenticule": "base optics frames display player",
    "apps/lenticule-tools": "base optics frames scenes render display calib player farm "
                            "apps/lenticule",
    # Only benchmarks and tests use the lab.
    "lab": "base optics frames scenes render calib player apps/lenticule-tools",
    "apps/lenticule-bench": "base optics frames scenes render display calib player farm apps/lenticule "
                            "apps/lenticule-tools lab",
}

# the beginning of a header's name: the modules that may name it
LIBRARIES = {
    "embree": "render lab",
    "OpenImageIO": "frames",
    "libheif": "frames",
    "jpeglib": "frames",
    "assimp": "render",
    "draco": "render",
    "meshoptimizer": "render",
    "tbb": "render lab apps/lenticule-bench",
    "toml": "optics player",
    "xf86drm": "display",
    "libudev": "display",
    "linux/videodev2": "calib frames apps/lenticule-video",
    "ceres": "calib",
    "Eigen": "calib",
    "unsupported/Eigen": "calib",
    "turbojpeg": "calib apps/lenticule-web lab",
    "microhttpd": "apps/lenticule-web",
    "qrencode": "frames",
    "apriltag": "calib",
    "CLI": "apps/lenticule apps/lenticule-tools apps/lenticule-bench apps/lenticule-video "
           "apps/lenticule-web apps/lenticule-window",
    "SDL2": "apps/lenticule-window",
    "systemd": "player",
    "alsa": "player",
    "zstd": "frames lab apps/lenticule-bench",
    "lz4": "frames lab apps/lenticule-bench",
    "libav": "apps/lenticule-video",
    "libswresample": "apps/lenticule-video",
    "seccomp": "apps/lenticule-video",
}

# What prints to standard output or error. Formatting into a text and writing to an open file may stay.
PRINTS = re.compile(r"fmt::print *\(|std::(cout|cerr|clog)"
                    r"|[^a-z_](v?printf|vfprintf|puts|putchar|perror|psignal|v?dprintf) *\("
                    r"|[^a-z_](stdout|stderr)[^a-z_]")
MAY_PRINT = {"base/print.cpp", "base/error.cpp"}  # error.cpp: a failed check prints, then aborts
INCLUDE = re.compile(r'^\s*#\s*include\s+(?:"([^"]+)"|<([^>]+)>)')
VERSION = re.compile(r"^\s*#\s*(if|elif).*(_VERSION|_MAJOR)")
MAY_ASK_VERSION = {"render/accel/embree.h", "apps/lenticule-video/ffmpeg.h"}
KERNEL = re.compile(r"isa_(avx[0-9]+|neon)::")


def module_of(path):
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] == "apps" else parts[0]


def circles(arrows):
    """Returns the sets of folders that reach each other (Tarjan's strongly connected components)."""
    number, low, stack, found = {}, {}, [], []

    def visit(folder):
        number[folder] = low[folder] = len(number)
        stack.append(folder)
        for other in arrows.get(folder, ()):
            if other not in number:
                visit(other)
                low[folder] = min(low[folder], low[other])
            elif other in stack:
                low[folder] = min(low[folder], number[other])
        if low[folder] == number[folder]:
            circle = stack[stack.index(folder):]
            del stack[stack.index(folder):]
            if len(circle) > 1:
                found.append(circle)

    for folder in sorted(arrows):
        if folder not in number:
            visit(folder)
    return found


def check_line(file, module, line, wrong):
    """Returns the file of the tree that a line includes, if any."""
    if PRINTS.search(line) and file not in MAY_PRINT and not line.lstrip().startswith("//"):
        wrong.append(f"{file} may not print by itself, use base/print.h: {line.strip()}")
    if KERNEL.search(line) and file != "base/cpu.h":
        wrong.append(f"{file} may not name kernels of one instruction set")
    if VERSION.search(line) and file not in MAY_ASK_VERSION:
        wrong.append(f"{file} may not depend on a library's version: {line.strip()}")
    include = INCLUDE.match(line)
    if not include:
        return None
    own, foreign = include.groups()
    if own:
        other = module_of(own)
        if other in MAY_INCLUDE and other != module and other not in MAY_INCLUDE[module].split():
            wrong.append(f"{file} may not include {own}")
        return own
    for library, modules in LIBRARIES.items():
        if foreign.startswith(library) and module not in modules.split():
            wrong.append(f"{file} may not include <{foreign}>")
    return None


def check(tree):
    wrong = []
    arrows = collections.defaultdict(set)
    reasons = collections.defaultdict(list)
    sizes = collections.Counter()
    for module in MAY_INCLUDE:
        for path in sorted((tree / module).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            file = path.relative_to(tree).as_posix()
            folder = file.rpartition("/")[0]
            sizes[folder] += 1
            for line in path.read_text(encoding="utf-8").splitlines():
                own = check_line(file, module, line, wrong)
                to = own.rpartition("/")[0] if own else folder
                if to != folder and module_of(to) == module:
                    arrows[folder].add(to)
                    reasons[folder, to].append(f"{file} includes {own}")
    for path in (tree / "tests").rglob("*"):
        if path.suffix in (".h", ".cpp", ".py"):
            sizes[path.parent.relative_to(tree).as_posix()] += 1
    for circle in circles(arrows):
        wrong.append("a circle of folders: " + " ".join(sorted(circle)))
        for folder in circle:
            for other in circle:
                wrong += ["  " + reason for reason in reasons[folder, other][:3]]
    wrong += [f"{folder} holds {count} sources, {MOST_FILES} at most"
              for folder, count in sizes.items() if count > MOST_FILES]
    return wrong


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    wrong = check(pathlib.Path(sys.argv[1]))
    if wrong:
        sys.exit("wrong:\n  " + "\n  ".join(wrong))
    print("the structure of the sources is as docs/architecture.md says")


if __name__ == "__main__":
    main()
