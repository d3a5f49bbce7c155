#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Changes the files of a playlist's item while it plays, and restores them afterwards. Runs in the guest.

Usage: trickster.py STATISTICS TRICKS
STATISTICS is the file that the player writes. TRICKS is JSON: by source, the command to run when the player
has begun with the source, and the command to run when it has gone on.
"""

import json
import pathlib
import subprocess
import sys
import time


def playing_now(statistics):
    """Returns the source from which the player takes frames; empty before the first one."""
    try:
        return json.loads(pathlib.Path(statistics).read_text()).get("playlist", {}).get("source", "")
    except FileNotFoundError:
        return ""


def main(statistics, tricks):
    commands, before = json.loads(pathlib.Path(tricks).read_text()), ""
    while True:
        source = playing_now(statistics)
        if source != before:
            undo, do = commands.get(before, ["", ""])[1], commands.get(source, ["", ""])[0]
            subprocess.run(["sh", "-ec", f"{undo or ':'}\n{do or ':'}"], check=True)
            before = source
        time.sleep(0.2)


if __name__ == "__main__":
    main(*sys.argv[1:])
