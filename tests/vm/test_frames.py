# SPDX-License-Identifier: Apache-2.0
"""Tests that numbered frames are displayed completely, once and in order.

The renderer publishes the next frame only when the one before was seen and compared in every pixel,
so the asynchronous checks cannot miss one; that the player counts as many flips as frames leaves
no room for others in between.
"""

import time

import vkms
from numbered_frames import NumberedFrames, PacedRenderer
from playing import play, stats, wait_until_shown
from vm_test import Machine, require_program, vm_test

# Slow, quick, and quick with large frames: more than the ring has slots, which are used again.
MANY, FEW = 300, 6
SECONDS_PER_FRAME = 180  # a bound, not an expectation


def start(vm, frames, count):
    player = play(vm, frames, "--prime", "1", "--slots", "3", "--wait", "120")
    return player, PacedRenderer(frames, count)


def finish(vm, player, renderer, count):
    """Lets the sequence end; the player must have shown every frame once and no other."""
    renderer.allow(count + 1)
    result = player.wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == count, done
    assert done["kms"]["flips"] == count and done["frames_copied"] == count, done
    assert done["dropped"] == 0 and done["frames_released"] == 0, done
    assert done["exactness"]["exact"] == "yes", done["exactness"]
    return done


def check_every_dump(vm, width, height, count):
    frames = NumberedFrames(vm, width, height)
    before = vm.screendump()
    player, renderer = start(vm, frames, count)
    for number in range(count):
        renderer.allow(number + 1)
        before = next_screen(vm, before)
        frames.assert_shown_in(before, number)
    finish(vm, player, renderer, count)


def next_screen(vm, before):
    """Returns the first dump that differs from the last one."""
    deadline = time.monotonic() + SECONDS_PER_FRAME
    while True:
        begin = time.monotonic()
        seen = vm.screendump()
        if seen != before or begin > deadline:
            return seen
        time.sleep(2 * (time.monotonic() - begin))  # a dump stops the guest


VIRTIO = Machine(display="virtio-gpu")
VIRTIO_4K = Machine(display="virtio-gpu", width=3840, height=2160)
BOCHS = Machine(display="bochs")


@vm_test(VIRTIO, slow=True)
def virtio_shows_300_frames_exactly(vm):
    check_every_dump(vm, 1920, 1080, MANY)


@vm_test(VIRTIO)
def virtio_shows_each_frame_exactly(vm):
    check_every_dump(vm, 1920, 1080, FEW)


@vm_test(VIRTIO_4K, slow=True)
def virtio_shows_300_frames_exactly_at_4k(vm):
    check_every_dump(vm, 3840, 2160, MANY)


@vm_test(BOCHS, slow=True)
def bochs_shows_300_frames_exactly(vm):
    check_every_dump(vm, 1920, 1080, MANY)


@vm_test(BOCHS)
def bochs_shows_each_frame_exactly(vm):
    check_every_dump(vm, 1920, 1080, FEW)


# -- vkms -----------------------------------------------------------------------------------------

class CrcLog:
    """Collects the checksums of all composed frames over several captures: a writeback ends one."""

    def __init__(self, vm):
        self._vm = vm
        self._ended = []
        self.continue_log()

    def composed(self):
        return self._ended + vkms.parse_crcs(self._capture.stdout if self._capture else "")

    def wait_for(self, expected, number):
        """Waits until the newest composed frame is the expected one."""
        deadline = time.monotonic() + SECONDS_PER_FRAME
        while True:
            newest = self.composed()[-1:]
            if newest and newest[0].crc == expected:
                return
            assert self._capture.running() and time.monotonic() < deadline, (number, newest)
            time.sleep(0.02)

    def pause(self):
        self._capture.kill()
        self._ended, self._capture = self.composed(), None

    def continue_log(self):
        self._capture = vkms.start_crc_capture(self._vm)


def changes(crcs):
    return [crc for at, crc in enumerate(crcs) if at == 0 or crcs[at - 1] != crc]


def check_every_crc(vm, width, height, count, writeback_every):
    """Checks every frame by the driver's checksum, and some frames by their pixels."""
    writeback = require_program(vm, "vm_writeback_capture")
    frames = NumberedFrames(vm, width, height)
    player, renderer = start(vm, frames, count)
    renderer.allow(1)
    wait_until_shown(vm, player)
    log = CrcLog(vm)
    expected = []
    for number in range(count):
        renderer.allow(number + 1)
        expected.append(vkms.expected_crc(frames.frame(number)))
        log.wait_for(expected[-1], number)
        if number % writeback_every == 0:
            log.pause()
            frames.assert_shown_in(vkms.writeback(vm, player.pid, writeback), number)
            log.continue_log()
    log.pause()
    composed = changes([frame.crc for frame in log.composed()])
    assert len(set(expected)) == count
    assert composed == expected, f"{len(composed)} changes, not {count}"
    done = finish(vm, player, renderer, count)
    assert done["clock"] == "hardware", done


VKMS = Machine(modules=("vkms",))


@vm_test(VKMS, slow=True)
def vkms_composes_300_frames_exactly(vm):
    check_every_crc(vm, 1920, 1080, MANY, writeback_every=60)


@vm_test(VKMS)
def vkms_composes_each_frame_exactly(vm):
    check_every_crc(vm, 1920, 1080, FEW, writeback_every=3)
