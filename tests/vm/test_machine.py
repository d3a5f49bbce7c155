# SPDX-License-Identifier: Apache-2.0
"""Tests the harness itself: users, commands that do not end, files, udev."""

import time

from vm import CommandFailed
from vm_test import Machine, vm_test

VIRTIO = Machine(display="virtio-gpu")


@vm_test(VIRTIO)
def an_ordinary_user_has_no_privileges(vm):
    assert vm.check(["id", "-u"], uid=1000).stdout == "1000\n"
    assert "video" in vm.check(["id", "-Gn"], uid=1000, groups=("video",)).stdout.split()
    assert vm.run("echo x > /sys/class/drm/card0/uevent", uid=1000).code != 0


@vm_test(VIRTIO)
def a_command_that_does_not_end_is_killed_with_its_children(vm):
    try:
        vm.run("sleep 1000 & sleep 1000", timeout=1)
    except CommandFailed as failure:
        assert "not done after 1 s" in str(failure)
    else:
        raise AssertionError("it was not noticed")
    assert vm.run(["pgrep", "sleep"]).stdout == ""


@vm_test(VIRTIO)
def the_guest_cannot_write_into_this_tree(vm):
    assert vm.run(["touch", f"{vm.files}/written-by-the-guest"]).code != 0
    assert not (vm.files / "written-by-the-guest").exists()
    vm.check(["touch", "/etc/written-by-the-guest"])  # goes to the tmpfs above the host's files


@vm_test(VIRTIO, fresh=True)
def udev_names_the_card_and_reports_its_changes(vm):
    vm.start_udev()
    assert vm.check(["stat", "-c", "%G %a", "/dev/dri/card0"]).stdout == "video 660\n"
    links = vm.check(["ls", "/dev/dri/by-path"]).stdout
    assert "-card\n" in links, links
    monitor = vm.start(["udevadm", "monitor", "--udev", "--property", "--subsystem-match=drm"])
    monitor.wait_for_line("UDEV - the event", 20)
    deadline = time.monotonic() + 20  # printed before udev listens: repeat until an event
    while not all(line in monitor.stdout for line in ("ACTION=change", "DEVNAME=/dev/dri/card0")):
        assert time.monotonic() < deadline, monitor.stdout
        vm.write_file("/sys/class/drm/card0/uevent", "change")
        vm.listen(0.2)
