# SPDX-License-Identifier: Apache-2.0
"""Tests the units, rules and folders of udev/ under a real systemd with its sandbox."""

import json
import pathlib
import time

import picture
from content import Content
from guest_systemd import Systemd, Unit
from vm_test import Machine, require_program, vm_test

FILES = pathlib.Path(__file__).resolve().parents[2] / "udev"
PLAYER = "lenticule-player@lobby.service"
CONTROL = "/run/lenticule/lobby/control.sock"
KEPT = "/var/lib/lenticule/rigs"


def install(vm):
    """Installs the files of the package in the guest's temporary layer."""
    # No files of the build tree, which may lie in /tmp: the units have a /tmp of their own.
    for program in ("lenticule", "lenticule-pictures"):
        vm.check(["cp", require_program(vm, program), f"/usr/local/bin/{program}"])
    vm.check(["cp", vm.build / "modules" / "lenticule-pictures.so", "/usr/lib/"])
    for unit in FILES.glob("*.service"):
        vm.check(["cp", unit, "/etc/systemd/system/"])
    vm.check(["mkdir", "-p", "/etc/sysusers.d", "/etc/tmpfiles.d", "/etc/udev/rules.d"])
    vm.check(["cp", FILES / "lenticule.sysusers", "/etc/sysusers.d/lenticule.conf"])
    vm.check(["cp", FILES / "lenticule.tmpfiles", "/etc/tmpfiles.d/lenticule.conf"])
    vm.check(["cp", FILES / "70-lenticule.rules", "/etc/udev/rules.d/"])
    vm.check(["systemd-sysusers", "lenticule.conf"])
    vm.check(["systemd-tmpfiles", "--create", "lenticule.conf"])
    vm.start_udev()


def check_card(vm):
    """Checks that udev makes the card a unit, for the group video."""
    told = vm.check(["udevadm", "info", "/dev/dri/card0"]).stdout
    assert ":systemd:" in told, told
    assert vm.check(["stat", "-c", "%G %a", "/dev/dri/card0"]).stdout.strip() == "video 660"


def trim_of(vm):
    answer = vm.check(["lenticule", "ctl", "--json", "--socket", CONTROL, "status"]).stdout
    return json.loads(answer)["trim"]


def wait_for_offset(vm, wanted):
    deadline = time.monotonic() + 30
    while trim_of(vm)["offset_lenses"] != wanted:
        assert time.monotonic() < deadline, trim_of(vm)
        time.sleep(0.5)


def check_rig_store(vm, unit):
    """A trim made during playback stays over a restart, until the administrator edits the rig."""
    answer = vm.check(["lenticule", "ctl", "--json", "--socket", CONTROL, "trim",
                       "--offset", "0.125"]).stdout
    assert json.loads(answer)["saved"], answer
    assert "0.125" in vm.check(["cat", f"{KEPT}/lobby.trim.toml"]).stdout
    assert vm.run("test -e /etc/lenticule/lobby.trim.toml").code == 1
    before = unit.wait_for_main_process()
    unit.check("restart", "--no-block")
    unit.wait_for_main_process(other_than=before)
    wait_for_offset(vm, 0.125)
    vm.check("sed -i 's/^offset_lenses = .*/offset_lenses = 0.25/' /etc/lenticule/lobby.toml")
    wait_for_offset(vm, 0.0)
    assert "offset_lenses = 0.25" in vm.check(["cat", f"{KEPT}/lobby.toml"]).stdout
    assert "offset_lenses = 0.0" in vm.check(["cat", f"{KEPT}/lobby.1.toml"]).stdout


@vm_test(Machine(display="virtio-gpu", width=640, height=480, processors=1), fresh=True)
def systemd_keeps_the_picture_over_a_crash(vm):
    install(vm)
    check_card(vm)
    content = Content(vm, 640, 480, 3)
    vm.check("mkdir -p /var/lib/lenticule/film")
    vm.check(f"cp {content.guest}/*.png /var/lib/lenticule/film/")
    vm.check("chown -R lenticule:lenticule /var/lib/lenticule")
    vm.check(["cp", content.rig, "/etc/lenticule/lobby.toml"])
    vm.write_file("/etc/lenticule/lobby.conf",
                  "SOURCE=/var/lib/lenticule/film/%05d.png\nOPTIONS=--frames 1:2\n")
    unit = Unit(Systemd(vm), PLAYER)
    unit.check("start", "--no-block")
    first = unit.wait_for_main_process()
    vm.wait_for_screen(content.frame(1))
    now = unit.facts("NFileDescriptorStore")
    assert now["NFileDescriptorStore"] == "2", now
    time.sleep(12)  # longer than the watchdog's timeout
    assert unit.wait_for_main_process() == first, unit.journal()
    assert "EXACT yes" in unit.facts("StatusText")["StatusText"], unit.journal()

    before = vm.screendump()
    unit.check("kill", "--signal=KILL", "--kill-whom=main")
    picture.assert_same(vm.screendump(), before)
    second = unit.wait_for_main_process(other_than=first)
    picture.assert_same(vm.screendump(), before)
    stats = json.loads(vm.read_file("/run/lenticule/lobby/stats.json"))
    assert stats["kms"]["took_over"], stats["kms"]
    assert stats["real_time_priority"], stats

    unit.check("kill", "--signal=STOP", "--kill-whom=main")
    unit.wait_for_main_process(other_than=second)  # the watchdog has ended it
    picture.assert_same(vm.screendump(), before)

    check_rig_store(vm, unit)
    unit.check("stop")
    deadline = time.monotonic() + 20
    while vm.screendump() == before and time.monotonic() < deadline:
        time.sleep(0.2)
    assert vm.screendump() != before  # the console is back
