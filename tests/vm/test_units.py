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


class Systemd:
    """systemd as first process of a namespace: the guest's own first process is the agent."""

    def __init__(self, vm):
        self.vm = vm
        vm.check("mkdir -p /sys/fs/cgroup && mount -t cgroup2 none /sys/fs/cgroup")
        self.process = vm.start(["unshare", "--fork", "--pid", "--mount", "--mount-proc",
                                 "env", "container=test", "/lib/systemd/systemd", "--system",
                                 "--unit=sysinit.target", "--show-status=no"])
        deadline = time.monotonic() + 180
        while self.systemctl("is-active", "--quiet", "sysinit.target").code != 0:
            assert self.process.running() and time.monotonic() < deadline, (
                self.process.stdout, self.process.stderr, self.systemctl("list-jobs"))
            time.sleep(0.5)

    def systemctl(self, *words):
        """From within its namespace: it talks to nobody outside."""
        outside = self.process.pid
        return self.vm.run("pid=$(cat /proc/%d/task/%d/children) && exec nsenter --target $pid "
                           "--pid --mount systemctl %s" % (outside, outside, " ".join(words)), 60)

    def check(self, *words):
        result = self.systemctl(*words)
        assert result.code == 0, (result, self.journal())
        return result.stdout

    def facts(self, *names):
        shown = self.check("show", UNIT, *(f"-p{name}" for name in names))
        return dict(line.split("=", 1) for line in shown.splitlines())

    def wait_for_main_process(self, other_than=None, timeout=120):
        """Waits until the unit is active; returns its player's process id, as systemd counts."""
        deadline = time.monotonic() + timeout
        while True:
            now = self.facts("ActiveState", "MainPID", "StatusText", "Result", "NRestarts")
            if now["ActiveState"] == "active" and now["MainPID"] not in ("0", other_than):
                return now["MainPID"]
            assert time.monotonic() < deadline, (now, self.journal())
            time.sleep(0.5)

    def journal(self):
        return (self.systemctl("status", "--no-pager", "--lines=40", UNIT).stdout
                + self.process.stderr[-2000:])


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
    systemd = Systemd(vm)
    systemd.check("start", "--no-block", UNIT)
    first = systemd.wait_for_main_process()
    vm.wait_for_screen(content.frame(1))
    now = systemd.facts("NFileDescriptorStore")
    assert now["NFileDescriptorStore"] == "2", now
    time.sleep(12)  # longer than the watchdog's patience
    assert systemd.wait_for_main_process() == first, systemd.journal()
    assert "EXACT yes" in systemd.facts("StatusText")["StatusText"], systemd.journal()

    before = vm.screendump()
    systemd.check("kill", "--signal=KILL", "--kill-whom=main", UNIT)
    picture.assert_same(vm.screendump(), before)
    second = systemd.wait_for_main_process(other_than=first)
    picture.assert_same(vm.screendump(), before)
    stats = json.loads(vm.read_file("/run/lenticule/lobby/stats.json"))
    assert stats["kms"]["took_over"], stats["kms"]
    assert stats["real_time_priority"], stats

    systemd.check("kill", "--signal=STOP", "--kill-whom=main", UNIT)
    systemd.wait_for_main_process(other_than=second)  # the watchdog has ended it
    picture.assert_same(vm.screendump(), before)

    systemd.check("stop", UNIT)
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
