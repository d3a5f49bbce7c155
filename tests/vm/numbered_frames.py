# SPDX-License-Identifier: Apache-2.0
"""Makes frames whose every pixel contains their number, and pushes them into a player.

Frame N is a woven picture under noise, with N added to every pixel: red and blue carry the low byte
of N, green carries both bytes. So any two frames differ in every pixel, a mixture of two shows as
such, and no shift, swap or scaling goes unnoticed. paced_renderer.cpp computes the same in the guest.
"""

import json
import subprocess

import picture
from content import Content
from vm_test import require_program

SOCKET = "/tmp/ring.sock"


class NumberedPictures:
    """The arithmetic: from a base picture to frame N and back."""

    def __init__(self, base):
        self.size = (base.width, base.height)
        self._channels = [base.rgb[channel::3] for channel in range(3)]

    def frame(self, number):
        rgb = bytearray(self.size[0] * self.size[1] * 3)
        for channel, values in enumerate(self._values(number)):
            rgb[channel::3] = values
        return picture.Picture(*self.size, bytes(rgb))

    def shown_in(self, seen, number):
        """Returns true if every pixel of the picture is that of frame(number)."""
        return (seen.width, seen.height) == self.size and all(
            seen.rgb[channel::3] == values for channel, values in enumerate(self._values(number)))

    def assert_shown_in(self, seen, number):
        if not self.shown_in(seen, number):
            raise AssertionError(f"frame {number} is due, {self._claim(seen)}: "
                                 f"{picture.describe_difference(seen, self.frame(number))}")

    def _values(self, number):
        """Returns the values, one channel after the other."""
        low, high = number & 255, number >> 8
        for channel, added in enumerate((low, low + high, -low)):
            yield self._channels[channel].translate(_plus(added))

    def _claim(self, seen):
        """Returns the number in the first pixel."""
        red, green, _ = (seen.rgb[channel] - self._channels[channel][0] for channel in range(3))
        return f"the first pixel says {(red & 255) + ((green - red & 255) << 8)}"


class NumberedFrames(NumberedPictures):
    """The frames of a test on the host; their base and rig are shared with the guest."""

    def __init__(self, vm, width, height):
        woven = Content(vm, width, height, 1)
        base = picture.combined(woven.frame(0), picture.noise(width, height, seed=width))
        super().__init__(base)
        self.vm = vm
        self.rig = woven.rig
        self.fingerprint = _fingerprint(vm, woven)
        self.base = f"{woven.guest}/base.ppm"
        (woven.folder / "base.ppm").write_bytes(base.ppm())

    def source(self):
        return f"ring:{SOCKET}"


class PacedRenderer:
    """A renderer in the guest that publishes no more frames than allow() says."""

    def __init__(self, frames, count, paced=True):
        vm = frames.vm
        self._allowed = vm.exchange / "allowed"
        self._allowed.unlink(missing_ok=True)
        command = [require_program(vm, "vm_paced_renderer"), SOCKET, frames.fingerprint,
                   frames.base, count]
        self.process = vm.start(command + (["/exchange/allowed"] if paced else []))

    def allow(self, count):
        """Writes the number atomically: the guest must never read half of it."""
        written = self._allowed.with_suffix(".new")
        written.write_text(f"{count}\n")
        written.replace(self._allowed)


def _plus(added):
    return bytes((value + added) & 255 for value in range(256))


def _fingerprint(vm, woven):
    shown = subprocess.run([require_program(vm, "lenticule"), "rig", "show", "--json",
                            woven.folder / "rig.toml"], check=True, capture_output=True, timeout=60)
    return json.loads(shown.stdout)["fingerprint"]
