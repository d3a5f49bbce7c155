# SPDX-License-Identifier: Apache-2.0
"""Starts lenticule play in a guest, reads its statistics and controls it."""

import json
import time

from vm_test import require_program

STATS = "/tmp/stats.json"
SOCKET = "/tmp/control.sock"


def play_command(vm, content, *flags):
    """Returns the command; content (Content or NumberedFrames) has the source and rig."""
    return [require_program(vm, "lenticule"), "play", content.source(), "--rig", content.rig,
            "--display", "kms", "--stats", STATS, *flags]


def play(vm, content, *flags, **options):
    """Starts a player. Options: see VirtualMachine.start()."""
    vm.run(["rm", "-f", STATS])
    return vm.start(play_command(vm, content, *flags), **options)


def stats(vm):
    return json.loads(vm.read_file(STATS))


def wait_until_shown(vm, player, count=1, timeout=60):
    """Waits until the player reports that many frames; returns its statistics."""
    deadline = time.monotonic() + timeout
    while True:
        running = player.running()
        if vm.run(["test", "-e", STATS]).code == 0:
            now = stats(vm)
            if now.get("shown", 0) >= count:
                return now
        assert running and time.monotonic() < deadline, (player.stdout, player.stderr)
        time.sleep(0.2)


def ctl(vm, *words):
    """Returns the answer of the player that listens on SOCKET."""
    program = require_program(vm, "lenticule")
    return json.loads(vm.check([program, "ctl", "--socket", SOCKET, "--json", *words], 60).stdout)


def wait_until(condition, *processes, seconds=60):
    """Waits for a condition; fails with what the processes have written."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, [(p.stdout[-3000:], p.stderr[-1000:]) for p in processes]
        time.sleep(0.1)
