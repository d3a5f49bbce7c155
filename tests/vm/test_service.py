# SPDX-License-Identifier: Apache-2.0
"""Tests the picture after a player's end, and the messages to a service manager."""

import pathlib
import time

import picture
from content import Content
from playing import play, play_command, wait_until_shown
from vm_test import Machine, vm_test

HERE = pathlib.Path(__file__).resolve().parent
VIRTIO = Machine(display="virtio-gpu")
SMALL = Machine(display="virtio-gpu", width=640, height=480)


def wait_for_lines(process, text, count, timeout):
    """Waits until so many lines begin with text."""
    deadline = time.monotonic() + timeout
    while True:
        lines = [line for line in process.stdout.splitlines() if line.startswith(text)]
        if len(lines) >= count:
            return lines
        assert process.running() and time.monotonic() < deadline, (process.stdout, process.stderr)
        time.sleep(0.1)


def start_service(vm, content, *flags, **options):
    vm.run(["rm", "-f", "/tmp/start"])
    return vm.start([str(HERE / "service_host.py"), "10",
                     *play_command(vm, content, "--loop", "forever", *flags)], **options)


def buffers(vm):
    """Returns the card's buffers: how many can be scanned out, and bytes of shared memory."""
    listed = vm.check("cat /sys/kernel/debug/dri/0/framebuffer").stdout
    shared = vm.check("grep Shmem: /proc/meminfo").stdout.split()[1]
    return listed.count("framebuffer["), int(shared) * 1024


def check_lives(vm, width, height, lives, gap_seconds):
    """Players killed one after the other, as ordinary users, with what systemd does about it: the
    picture stays, the next one goes on in the same buffers."""
    content = Content(vm, width, height, 3)
    vm.start_udev()
    service = start_service(vm, content, "--frames", "1:2", uid=1000, groups=("video",))
    for life in range(1, lives + 1):
        wait_for_lines(service, "READY", life, 60)
        vm.wait_for_screen(content.frame(1))
        before = vm.screendump()
        if life == 2:
            settled = buffers(vm)
        child = wait_for_lines(service, "started", life, 10)[-1].split()[1]
        vm.check(["kill", "-9", child])
        wait_for_lines(service, "ended -9", life, 20)
        time.sleep(gap_seconds)
        picture.assert_same(vm.screendump(), before)
        vm.check(["touch", "/tmp/start"], uid=1000)
    wait_for_lines(service, "READY", lives + 1, 60)
    picture.assert_same(vm.screendump(), content.frame(1))
    assert service.stderr.count("started by a modeset") <= 1, service.stderr  # the first one perhaps
    assert service.stderr.count("taken over without a modeset") >= lives, service.stderr
    framebuffers, shared = buffers(vm)
    assert framebuffers == settled[0], (framebuffers, settled)
    assert shared < settled[1] + 2 * width * height * 4, (shared, settled)


@vm_test(SMALL, fresh=True)
def a_killed_player_leaves_its_frame_to_the_next_one(vm):
    check_lives(vm, 640, 480, 3, gap_seconds=2)  # the console returns if no process holds the card


@vm_test(SMALL, fresh=True, slow=True)
def fifty_killed_players_leak_no_buffer(vm):
    check_lives(vm, 640, 480, 50, gap_seconds=0)


@vm_test(VIRTIO)
def reports_its_state_to_the_service_manager(vm):
    content = Content(vm, 1920, 1080, 3)
    service = start_service(vm, content, "--fps", "2")
    service.wait_for_line("READY 1", 60)
    [status, *_] = wait_for_lines(service, "STATUS EXACT", 1, 20)
    assert status.startswith("STATUS EXACT yes"), status
    wait_for_lines(service, "WATCHDOG 1", 2, 60)
    child = service.wait_for_line("started", 1).split()[1]
    # A stopped process sends no pings.
    vm.check(["kill", "-STOP", child])
    time.sleep(1)
    pings = service.stdout.count("WATCHDOG")
    time.sleep(6)
    assert service.stdout.count("WATCHDOG") == pings, service.stdout
    vm.check(["kill", "-CONT", child])
    wait_for_lines(service, "WATCHDOG 1", pings + 1, 60)
    vm.check(["kill", "-TERM", child])
    service.wait_for_line("STOPPING 1", 30)


@vm_test(SMALL, fresh=True)
def waits_for_a_panel_that_is_off_at_the_start(vm):
    content = Content(vm, 640, 480, 3)
    vm.start_udev()
    connector = "/sys/class/drm/card0-Virtual-1/status"
    vm.write_file(connector, "off")
    refused = vm.run(play_command(vm, content), 60)
    assert refused.code == 3 and "no panel is connected" in refused.stderr, refused
    player = play(vm, content, "--frames", "2:3", "--loop", "forever",
                  "--wait-for-panel", "forever")
    time.sleep(3)
    assert player.running(), player.stderr
    vm.write_file(connector, "on")
    wait_until_shown(vm, player)
    vm.wait_for_screen(content.frame(2))
