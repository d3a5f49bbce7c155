# SPDX-License-Identifier: Apache-2.0
"""The units, rules and folders of udev/ under a real systemd, with its sandbox and descriptor store."""

import json
import pathlib
import time

import picture
from content import Content
from vm_test import Machine, require_program, vm_test

FILES = pathlib.Path(__file__).resolve().parents[2] / "udev"
UNIT = "lenticule-player@lobby.service"


def install(vm):
    """What the package does, on the guest's throw-away layer."""
    # Not a link into the build tree: the units have a /tmp of their own.
    vm.check(["cp", require_program(vm, "lenticule"), "/usr/local/bin/lenticule"])
    for unit in FILES.glob("*.service"):
        vm.check(["cp", unit, "/etc/systemd/system/"])
    vm.check(["mkdir", "-p", "/etc/sysusers.d", "/etc/tmpfiles.d", "/etc/udev/rules.d"])
    vm.check(["cp", FILES / "lenticule.sysusers", "/etc/sysusers.d/lenticule.conf"])
    vm.check(["cp", FILES / "lenticule.tmpfiles", "/etc/tmpfiles.d/lenticule.conf"])
    vm.check(["cp", FILES / "70-lenticule.rules", "/etc/udev/rules.d/"])
    vm.check(["systemd-sysusers", "lenticule.conf"])
    vm.check(["systemd-tmpfiles", "--create", "lenticule.conf"])
    vm.start_udev()


def start_systemd(vm):
    """systemd as first process of a namespace: the guest's own first process is the agent."""
    vm.check("mkdir -p /sys/fs/cgroup && mount -t cgroup2 none /sys/fs/cgroup")
    systemd = vm.start(["unshare", "--fork", "--pid", "--mount", "--mount-proc",
                        "env", "container=test", "/lib/systemd/systemd", "--system",
                        "--unit=sysinit.target", "--show-status=no"])
    deadline = time.monotonic() + 120
    while vm.run(["systemctl", "is-active", "--quiet", "sysinit.target"]).code != 0:
        assert systemd.running() and time.monotonic() < deadline, (
            systemd.stdout, systemd.stderr, vm.run(["systemctl", "list-jobs"]).stdout)
        time.sleep(0.5)


def facts(vm, *names):
    shown = vm.check(["systemctl", "show", UNIT, *(f"-p{name}" for name in names)]).stdout
    return dict(line.split("=", 1) for line in shown.splitlines())


def wait_for_main_process(vm, other_than=None, timeout=90):
    """Waits until the unit is active; returns the process id of its player, as systemd counts."""
    deadline = time.monotonic() + timeout
    while True:
        now = facts(vm, "ActiveState", "SubState", "MainPID", "StatusText", "Result", "NRestarts")
        if now["ActiveState"] == "active" and now["MainPID"] not in ("0", other_than):
            return now["MainPID"]
        assert time.monotonic() < deadline, (now, journal(vm))
        time.sleep(0.3)


def journal(vm):
    return vm.run(["journalctl", "--no-pager", "-o", "cat", "-n", "60"]).stdout


@vm_test(Machine(display="virtio-gpu"), fresh=True)
def systemd_keeps_the_picture_over_a_crash(vm):
    install(vm)
    content = Content(vm, 1920, 1080, 3)
    vm.check("mkdir -p /var/lib/lenticule/film")
    vm.check(f"cp {content.guest}/*.png /var/lib/lenticule/film/")
    vm.check("chown -R lenticule:lenticule /var/lib/lenticule")
    vm.check(["cp", content.rig, "/etc/lenticule/lobby.toml"])
    vm.write_file("/etc/lenticule/lobby.conf",
                  "SOURCE=/var/lib/lenticule/film/%05d.png\nOPTIONS=--frames 1:2\n")
    start_systemd(vm)
    vm.check(["systemctl", "start", "--no-block", UNIT])
    first = wait_for_main_process(vm)
    vm.wait_for_screen(content.frame(1))
    now = facts(vm, "StatusText", "NFileDescriptorStore")
    assert now["NFileDescriptorStore"] == "2", now
    time.sleep(12)  # longer than the watchdog's patience
    assert wait_for_main_process(vm) == first, journal(vm)
    assert "EXACT yes" in facts(vm, "StatusText")["StatusText"], facts(vm, "StatusText")

    before = vm.screendump()
    vm.check(["systemctl", "kill", "--signal=KILL", "--kill-whom=main", UNIT])
    picture.assert_same(vm.screendump(), before)
    second = wait_for_main_process(vm, other_than=first)
    picture.assert_same(vm.screendump(), before)
    stats = json.loads(vm.read_file("/run/lenticule/lobby/stats.json"))
    assert stats["kms"]["took_over"], stats["kms"]
    assert stats["real_time_priority"], stats

    vm.check(["systemctl", "kill", "--signal=STOP", "--kill-whom=main", UNIT])
    wait_for_main_process(vm, other_than=second)  # the watchdog has ended it
    picture.assert_same(vm.screendump(), before)

    vm.check(["systemctl", "stop", UNIT])
    deadline = time.monotonic() + 20
    while vm.screendump() == before and time.monotonic() < deadline:
        time.sleep(0.2)
    assert vm.screendump() != before  # the console is back


@vm_test(Machine(display="virtio-gpu"), fresh=True)
def udev_makes_the_card_a_unit_for_the_group_video(vm):
    install(vm)
    told = vm.check(["udevadm", "info", "/dev/dri/card0"]).stdout
    assert ":systemd:" in told, told
    assert vm.check(["stat", "-c", "%G %a", "/dev/dri/card0"]).stdout.strip() == "video 660"
