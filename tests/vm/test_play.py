# SPDX-License-Identifier: Apache-2.0
"""Tests lenticule play on the kernel's drivers: pictures from files, and the choice of panel."""

import json
import signal

import picture
from content import Content
from playing import play, play_command, stats, wait_until_shown
from vm_test import Machine, require_program, vm_test


def check_held_frame(vm, content, number):
    """Plays frame `number` in a loop and expects exactly that frame in QEMU."""
    player = play(vm, content, "--frames", f"{number}:{number + 1}", "--loop", "forever")
    shown = wait_until_shown(vm, player)
    vm.wait_for_screen(content.frame(number))
    other = content.frame(number).with_pixel(3, 5, (1, 2, 3))
    assert picture.differing_pixels(vm.screendump(), other) == 1
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr
    return shown


VIRTIO = Machine(display="virtio-gpu")


@vm_test(VIRTIO)
def virtio_shows_a_held_frame_exactly(vm):
    shown = check_held_frame(vm, Content(vm, 1920, 1080, 3), 1)
    assert shown["exactness"]["exact"] == "yes", shown["exactness"]
    assert shown["clock"] == ("hardware" if vm.counts_vblanks_by_timer() else "software"), shown["clock"]


@vm_test(VIRTIO)
def counts_each_frame_of_a_sequence_once(vm):
    content = Content(vm, 1920, 1080, 3)
    player = play(vm, content, "--fps", "3", "--loop", "4")
    result = player.wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == 12, done
    assert done["kms"]["flips"] == 12, done["kms"]
    assert done["dropped"] == 0 and done["kms"]["modesets"] == 0, done


@vm_test(VIRTIO)
def the_console_comes_back_afterwards(vm):
    content = Content(vm, 1920, 1080, 3)
    vm.check("echo before > /dev/tty1")
    before = vm.screendump()
    check_held_frame(vm, content, 0)
    vm.wait_for_screen(before)


# -- which panel ----------------------------------------------------------------------------------

def identity_of_panel(vm):
    lenticule = require_program(vm, "lenticule")
    panels = json.loads(vm.check([lenticule, "panels", "--json"]).stdout)["panels"]
    [panel] = [panel for panel in panels if panel["connected"]]
    return panel["identity"]


@vm_test(VIRTIO)
def plays_on_the_panel_that_the_rig_names(vm):
    identity = identity_of_panel(vm)
    content = Content(vm, 1920, 1080, 3, identity=(
        f'[identity]\nmanufacturer = "{identity["manufacturer"]}"\n'
        f'edid_sha256 = "{identity["edid_sha256"]}"\n'))
    check_held_frame(vm, content, 0)


@vm_test(VIRTIO)
def refuses_a_panel_that_the_rig_does_not_name(vm):
    content = Content(vm, 1920, 1080, 3, identity='[identity]\nmanufacturer = "XYZ"\n')
    before = vm.screendump()
    result = vm.run(play_command(vm, content), 60)
    assert result.code == 4, result
    assert "XYZ" in result.stderr and "Virtual-1" in result.stderr, result.stderr
    picture.assert_same(vm.screendump(), before)


@vm_test(VIRTIO)
def refuses_a_rig_of_another_size(vm):
    result = vm.run(play_command(vm, Content(vm, 1000, 712, 1)), 60)
    assert result.code == 4, result
    assert "1920x1080" in result.stderr, result.stderr
