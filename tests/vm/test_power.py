# SPDX-License-Identifier: Apache-2.0
"""Tests that a player switches its output off and on again on the kernel's drivers."""

import pathlib
import re
import time

import vkms
from content import Content
from playing import SOCKET, ctl, play, play_command, stats, wait_until, wait_until_shown
from vm_test import Machine, require_program, vm_test

HERE = pathlib.Path(__file__).resolve().parent
VIRTIO = Machine(display="virtio-gpu")
VKMS = Machine(modules=("vkms",))


def active_outputs(vm):
    """Returns how many CRTCs the kernel reports as active."""
    # Each card is listed several times, once per node.
    states = vm.check("for file in /sys/kernel/debug/dri/*/state; do cat $file; echo END; done")
    return max(len(re.findall(r"^\s*active=1$", state, re.MULTILINE))
               for state in states.stdout.split("END\n"))


def check_power(vm, still_exact):
    """Switches the output of a player off and on. still_exact(player, frame) checks the picture."""
    content = Content(vm, 1920, 1080, 3)
    player = play(vm, content, "--frames", "1:2", "--loop", "forever", "--control", SOCKET)
    before = wait_until_shown(vm, player)
    still_exact(player, content.frame(1))
    assert active_outputs(vm) == 1
    for _ in range(2):
        assert ctl(vm, "power", "off") == {"power": "off", "done": True}
        assert active_outputs(vm) == 0
        assert ctl(vm, "status")["state"] == "off"
        time.sleep(2)
        assert active_outputs(vm) == 0
        assert ctl(vm, "power", "on") == {"power": "on", "done": True}
        wait_until(lambda: active_outputs(vm) == 1)
        still_exact(player, content.frame(1))
    time.sleep(1.5)  # the statistics are written once a second
    after = stats(vm)
    assert after["exactness"]["exact"] == "yes", after["exactness"]
    assert after["kms"]["modesets"] == before["kms"]["modesets"] + 2, after["kms"]
    assert after["held"] >= before["held"] + 2 * 60, after
    assert ctl(vm, "status")["state"] == "playing"
    assert player.running(), player.stderr
    assert player.stderr.count("switched on again, EXACT yes") == 2, player.stderr


@vm_test(VIRTIO)
def virtio_shows_the_frame_exactly_after_the_output_was_off(vm):
    check_power(vm, lambda _, frame: vm.wait_for_screen(frame))


@vm_test(VKMS, slow=True)
def vkms_composes_the_frame_exactly_after_the_output_was_off(vm):
    def still_exact(_, frame):
        wanted = vkms.expected_crc(frame)
        wait_until(lambda: vkms.vkms_crc_of_next_frames(vm, 1)[0].crc == wanted)
    check_power(vm, still_exact)


@vm_test(Machine(display="virtio-gpu", width=640, height=480), fresh=True)
def an_output_that_is_off_stays_off_when_the_player_is_killed(vm):
    content = Content(vm, 640, 480, 3)
    service = vm.start([str(HERE / "service_host.py"), "10",
                        *play_command(vm, content, "--loop", "forever", "--control", SOCKET)])
    service.wait_for_line("READY 1", 60)
    assert ctl(vm, "power", "off")["done"]
    time.sleep(2)  # the state is stored once a second
    child = service.wait_for_line("started", 1).split()[1]
    vm.check(["kill", "-9", child])
    service.wait_for_line("ended -9", 20)
    vm.check(["touch", "/tmp/start"])
    wait_until(lambda: service.stdout.count("READY 1") == 2)
    wait_until(lambda: active_outputs(vm) == 0)
    assert ctl(vm, "status")["state"] == "off"
    assert ctl(vm, "power", "on")["done"]
    wait_until(lambda: active_outputs(vm) == 1)
