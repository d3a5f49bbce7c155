# SPDX-License-Identifier: Apache-2.0
"""Tests the proof of play of a kiosk whose machine loses its power in the middle of an item."""

import json
import time

from content import Content
from guest_systemd import Systemd, Unit
from test_units import PLAYER, install
from vm_test import Machine, vm_test

JOURNAL = "/var/log/journal"
FILM = "/var/lib/lenticule/film"
LIST = f"""format = 1
[[item]]
source = "{FILM}/%05d.png"
fps = "4"
[[item]]
source = "{FILM}/00000.png"
duration_s = 100000
"""
# What docs/play/report.md advises: the journal is written to the disk every second.
CONFIGURATION = "[Journal]\nStorage=persistent\nSyncIntervalSec=1s\n"


def prepare(vm, content):
    """Sets up a kiosk whose journal is on the disk. A machine that has booted has nothing else."""
    install(vm)
    vm.load_module("virtio_blk")
    vm.load_module("ext4")
    vm.wait_for_path("/dev/vda")
    vm.check("blkid /dev/vda || mkfs.ext4 -q /dev/vda", 120)
    vm.check(f"mkdir -p {JOURNAL} {FILM} /etc/systemd/journald.conf.d && mount /dev/vda {JOURNAL}")
    vm.write_file("/etc/systemd/journald.conf.d/kiosk.conf", CONFIGURATION)
    vm.check(f"cp {content.guest}/*.png {FILM}/")
    vm.write_file(f"{FILM}/day.toml", LIST)
    vm.check("chown -R lenticule:lenticule /var/lib/lenticule && chmod -R a+rX /var/lib/lenticule")
    vm.check(["cp", content.rig, "/etc/lenticule/lobby.toml"])
    vm.write_file("/etc/lenticule/lobby.conf", f"SOURCE={FILM}/day.toml\n")


def start_kiosk(vm):
    systemd = Systemd(vm)
    Unit(systemd, PLAYER).check("start", "--no-block")
    return systemd


def report(systemd):
    return json.loads(systemd.check(f"lenticule report --json --unit {PLAYER}"))


def wait_for_report(systemd, wanted, timeout=300):
    deadline = time.monotonic() + timeout
    while not wanted(now := report(systemd)):
        assert time.monotonic() < deadline, (now, Unit(systemd, PLAYER).journal())
        time.sleep(1)
    return now


def wait_until_synced(systemd, timeout=120):
    """Waits until journald has written everything to the disk; its files are then offline."""
    deadline = time.monotonic() + timeout
    while "OFFLINE" not in systemd.check("journalctl --header | grep State:"):
        assert time.monotonic() < deadline, systemd.check("journalctl --header")
        time.sleep(0.2)


def plays_still(now):
    return [turn["item"] for turn in now["playing"]] == [f"{FILM}/00000.png"]


# report_test.cpp has the rest of the proof of play on a real journald.
@vm_test(Machine(display="virtio-gpu", width=640, height=480, disk_mib=256, processors=1), fresh=True, slow=True)
def a_power_failure_loses_no_play_but_the_one_that_runs(vm):
    content = Content(vm, 640, 480, 3)
    prepare(vm, content)
    systemd = start_kiosk(vm)
    before = wait_for_report(systemd, plays_still)
    [row] = before["rows"]
    assert (row["item"], row["whole"], row["frames"]) == (f"{FILM}/%05d.png", 1, 3), row
    assert row["unit"] == PLAYER and row["panel"] != "virtual", row
    assert row["exactness"] == "yes", row
    wait_until_synced(systemd)

    vm.lose_power()
    prepare(vm, content)
    systemd = start_kiosk(vm)
    after = wait_for_report(systemd, plays_still)
    film, still = after["rows"]
    assert (film["whole"], film["interrupted"], film["frames"]) == (2, 0, 6), after
    assert (still["whole"], still["interrupted"]) == (0, 1), after
    [unended] = after["without_end"]
    assert unended["item"] == f"{FILM}/00000.png", after
    assert after["ignored_entries"] == 0, after
