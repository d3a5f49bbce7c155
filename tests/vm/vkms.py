# SPDX-License-Identifier: Apache-2.0
"""Reads the checksums of the frames that the vkms driver composes, by vblank.

/sys/kernel/debug/dri/N/crtc-0/crc gives the CRC of every composed frame with its vblank number, to
root and without being the card's master, so it checks a running player from outside. The checksum
covers the composed line buffers: four little-endian 16-bit values per pixel (alpha, red, green,
blue), row after row, with 8-bit channels widened by 257 (0xAB becomes 0xABAB) and alpha 0xFFFF;
the kernel's crc32_le starts at 0 and inverts nothing. Emulated, composing a frame can take longer
than a vblank: then one checksum stands for several vblank numbers.
"""

import dataclasses
import shlex
import zlib

import picture


@dataclasses.dataclass(frozen=True)
class FrameCrc:
    vblank: int
    crc: int


def expected_crc(shown):
    """Returns the checksum of vkms for a CRTC that shows exactly this picture."""
    count = shown.width * shown.height
    composed = bytearray(b"\xff") * (count * 8)
    for channel in range(3):
        values = shown.rgb[channel::3]
        composed[2 + 2 * channel::8] = values
        composed[3 + 2 * channel::8] = values
    # zlib inverts before and after; the kernel does not.
    return zlib.crc32(composed, 0xFFFFFFFF) ^ 0xFFFFFFFF


def crc_folder(vm):
    return f"/sys/kernel/debug/dri/{vm.card('vkms')}/crtc-0/crc"


def parse_crcs(text):
    """Returns the frames in data of the kernel's crc/data: a line '0xVBLANK 0xCRC' and a 0 byte
    each."""
    frames = []
    for line in text.replace("\0", "").splitlines(keepends=True):
        words = line.split()
        if line.endswith("\n") and len(words) == 2 and words[0].startswith("0x"):
            frames.append(FrameCrc(int(words[0], 16), int(words[1], 16)))
    return frames


def start_crc_capture(vm):
    """Starts to record every frame's checksum; the CRTC must be active. kill() it to stop, then
    parse_crcs(its stdout)."""
    folder = crc_folder(vm)
    vm.write_file(f"{folder}/control", "auto")
    return vm.start(["cat", f"{folder}/data"])


def vkms_crc_of_next_frames(vm, count, timeout=60):
    """Returns the checksums of the next composed frames, in order; the CRTC must be active."""
    folder = crc_folder(vm)
    vm.write_file(f"{folder}/control", "auto")
    data = shlex.quote(f"{folder}/data")
    result = vm.check(f"head -n {count} {data}", timeout)
    return parse_crcs(result.stdout)


def writeback(vm, pid, program):
    """Returns the Picture that vkms composes for the process pid, the card's master.

    program: the path of vm_writeback_capture. See there for how it disturbs that process.
    """
    vm.check([program, pid, "/tmp/writeback.ppm"], 60)
    return picture.from_ppm(vm.read_file("/tmp/writeback.ppm"))
