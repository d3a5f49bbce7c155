# SPDX-License-Identifier: Apache-2.0
"""Tests a card from seatd while the user switches virtual terminals."""

import signal
import time

from content import Content
from vm_test import Machine, require_program, vm_test


def report(player, wanted, timeout=60):
    """Waits for a matching line of the player; returns its numbers by name."""
    deadline = time.monotonic() + timeout
    while True:
        lines = [line.split() for line in player.stdout.splitlines() if line.startswith("shown ")]
        for words in lines[-1:]:
            now = {name: int(value) for name, value in zip(words[::2], words[1::2])}
            if wanted(now):
                return now
        assert player.running() and time.monotonic() < deadline, (player.stdout, player.stderr)
        time.sleep(0.1)


def wait_until_not(vm, shown, timeout=30):
    deadline = time.monotonic() + timeout
    while vm.screendump() == shown:
        assert time.monotonic() < deadline, "the terminal did not come in front"
        time.sleep(0.2)


@vm_test(Machine(display="virtio-gpu", width=640, height=480), fresh=True)
def the_picture_comes_back_with_its_terminal(vm):
    content = Content(vm, 640, 480, 1)
    vm.check("chmod 600 /dev/dri/card0")  # accessible only through the seat
    vm.check("echo elsewhere >/dev/tty2")
    vm.check(["busybox", "chvt", "1"])
    console = vm.screendump()
    seatd = vm.start(["seatd", "-g", "video"])
    vm.wait_for_path("/run/seatd.sock")
    player = vm.start([require_program(vm, "vm_seat_player"), content.source(), content.rig],
                      uid=1000, groups=("video",), environment={"LIBSEAT_BACKEND": "seatd"})
    vm.wait_for_screen(content.frame(0), 60)
    for away in range(1, 3):
        vm.check(["busybox", "chvt", "2"])
        paused = report(player, lambda now, away=away: now["pauses"] >= away)
        wait_until_not(vm, content.frame(0))
        vm.check(["busybox", "chvt", "1"])
        vm.wait_for_screen(content.frame(0), 60)
        report(player, lambda now, before=paused: now["shown"] > before["shown"])
    assert seatd.running(), seatd.stderr
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 0, player.stderr
    vm.wait_for_screen(console)
