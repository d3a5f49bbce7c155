#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the largest memory that the processes of a control group have had, as JSON. Runs in the guest.

Usage: memory_watch.py CGROUP OUTPUT
own_kib: memory without files, summed over the processes, so that shared memory counts in each of them;
resident_kib: with the pages of program and library files.
"""

import json
import pathlib
import sys
import time


def memory_of(pid):
    """Returns both figures of one process; 0 if it has ended."""
    try:
        lines = pathlib.Path(f"/proc/{pid}/status").read_text().splitlines()
    except (FileNotFoundError, ProcessLookupError):
        return 0, 0
    kib = {line.split(":")[0]: int(line.split()[1]) for line in lines if line.startswith(("Rss", "VmRSS"))}
    return kib.get("RssAnon", 0) + kib.get("RssShmem", 0), kib.get("VmRSS", 0)


def main(group, output):
    most = {"own_kib": 0, "resident_kib": 0, "processes": 0, "samples": 0}
    while True:
        pids = pathlib.Path(group, "cgroup.procs").read_text().split()
        own, resident = map(sum, zip(*map(memory_of, pids))) if pids else (0, 0)
        now = {"own_kib": own, "resident_kib": resident, "processes": len(pids)}
        most = {key: max(most[key], now[key]) for key in now} | {"samples": most["samples"] + 1}
        written = pathlib.Path(output + ".new")
        written.write_text(json.dumps(most))
        written.replace(output)
        time.sleep(0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
