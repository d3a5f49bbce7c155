# SPDX-License-Identifier: Apache-2.0
"""Tests vkms, a card with a timer's vblanks whose composed frames can be read back."""

import picture
import vkms
from vm_test import Machine, require_program, vm_test

VKMS = Machine(modules=("vkms",))
SIZE = (640, 480)


def show(vm, shown, seconds=120):
    probe = require_program(vm, "vm_probe")
    vm.write_file("/tmp/shown.ppm", shown.ppm())
    process = vm.start([probe, "show", f"/dev/dri/card{vm.card('vkms')}", "/tmp/shown.ppm",
                        seconds])
    process.wait_for_line("shown", 60)
    return process


@vm_test(VKMS)
def offers_a_panel_and_a_writeback_connector(vm):
    probe = require_program(vm, "vm_probe")
    lines = vm.check([probe, "list", f"/dev/dri/card{vm.card('vkms')}"]).stdout.splitlines()
    assert any(line.startswith("connector Virtual-1 connected ") for line in lines), lines
    assert any(line.startswith("connector Writeback-1 ") for line in lines), lines


@vm_test(VKMS)
def its_vblank_sequence_advances(vm):
    process = show(vm, picture.noise(*SIZE, seed=1))
    vblanks = [line.split()[1:] for line in process.stdout.splitlines()
               if line.startswith("vblank ")]
    sequences = [int(sequence) for sequence, _ in vblanks]
    times = [int(nanoseconds) for _, nanoseconds in vblanks]
    assert len(sequences) == 5, vblanks
    assert sequences == sorted(set(sequences)) and times == sorted(set(times)), vblanks


@vm_test(VKMS)
def the_checksum_of_its_frames_is_the_expected_one(vm):
    shown = picture.noise(*SIZE, seed=2)
    process = show(vm, shown)
    frames = vkms.vkms_crc_of_next_frames(vm, 4)
    assert len(frames) == 4, frames
    assert [frame.vblank for frame in frames] == sorted({frame.vblank for frame in frames}), frames
    expected = vkms.expected_crc(shown)
    assert {frame.crc for frame in frames} == {expected}, (frames, hex(expected))
    process.kill()
    # The driver and the computation must both detect the smallest change.
    red, green, blue = shown.pixel(0, 0)
    changed = shown.with_pixel(0, 0, (red, green, blue ^ 1))
    show(vm, changed)
    [seen] = {frame.crc for frame in vkms.vkms_crc_of_next_frames(vm, 2)}
    assert seen != expected and seen == vkms.expected_crc(changed)


@vm_test(VKMS)
def writeback_returns_every_pixel_of_a_running_program(vm):
    capture = require_program(vm, "vm_writeback_capture")
    shown = picture.noise(*SIZE, seed=3)
    process = show(vm, shown)
    for _ in range(2):  # the first capture restores the pipe, so that a second one works
        picture.assert_same(vkms.writeback(vm, process.pid, capture), shown)
    assert process.running()
    red, green, blue = shown.pixel(5, 7)
    changed = shown.with_pixel(5, 7, (red ^ 1, green, blue))
    assert picture.differing_pixels(vkms.writeback(vm, process.pid, capture), changed) == 1


@vm_test(VKMS)
def both_references_agree_at_full_size(vm):
    capture = require_program(vm, "vm_writeback_capture")
    shown = picture.noise(1920, 1080, seed=4)
    process = show(vm, shown)
    [seen] = {frame.crc for frame in vkms.vkms_crc_of_next_frames(vm, 2)}
    assert seen == vkms.expected_crc(shown)
    picture.assert_same(vkms.writeback(vm, process.pid, capture), shown)
