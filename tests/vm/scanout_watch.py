#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the checksum of each picture that a card scans out for another program. Runs in the guest, as root.

Usage: scanout_watch.py CARD OUTPUT
Each line of OUTPUT is a checksum (see checksum_of), the number of looks that found it, one after the other,
the number of looks since the line before that were discarded, and the seconds between the last look before the
line and the line's first. Discarded: the program flipped meanwhile, so that it may have written to the buffer
that was being read. A buffer that is on the display must not change.
"""

import fcntl
import mmap
import os
import signal
import struct
import sys
import time
import zlib

LOOKS_PER_SECOND = 20
LONGEST_LOOK_S = 0.3  # less than two flips take, after which a buffer may be used again

DROP_MASTER, GET_RESOURCES, GET_CRTC = 0x641F, 0xC04064A0, 0xC06864A1
MAP_DUMB, GET_FRAMEBUFFER, CLOSE_HANDLE = 0xC01064B3, 0xC06864CE, 0x40086409
XRGB8888 = 0x34325258


def checksum_of(blue, green, red):
    """Returns the checksum of a picture of three channels."""
    return zlib.crc32(red, zlib.crc32(green, zlib.crc32(blue)))


class Card:
    """Reads the first CRTC of a card."""

    def __init__(self, path):
        self._fd = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.ioctl(self._fd, DROP_MASTER)  # the program under test must be able to become master
        except OSError:
            pass
        counts = self._call(GET_RESOURCES, struct.pack("=4Q8I", *[0] * 12))
        crtcs = (struct.unpack("=4Q8I", counts)[5] * 4) or 4
        space = bytearray(crtcs)
        address = _address_of(space)
        self._call(GET_RESOURCES, struct.pack("=4Q8I", 0, address, 0, 0, 0, crtcs // 4, 0, 0, *[0] * 4))
        self._crtc = struct.unpack_from("=I", space)[0]

    def framebuffer(self):
        """Returns the number of the framebuffer; 0 if there is none."""
        return struct.unpack_from("=QIII", self._call(
            GET_CRTC, struct.pack("=Q7I", 0, 0, self._crtc, *[0] * 5) + bytes(68)))[3]

    def checksum(self, framebuffer):
        """Returns the checksum of a framebuffer; None if the program has removed it."""
        try:
            found = self._call(GET_FRAMEBUFFER, struct.pack("=I", framebuffer) + bytes(100))
        except OSError:
            return None
        _, width, height, kind, _, handle = struct.unpack_from("=6I", found)
        pitch, offset = struct.unpack_from("=I", found, 36)[0], struct.unpack_from("=I", found, 52)[0]
        assert kind == XRGB8888 and handle, (kind, handle)
        try:
            place = struct.unpack("=IIQ", self._call(MAP_DUMB, struct.pack("=IIQ", handle, 0, 0)))[2]
            with mmap.mmap(self._fd, offset + pitch * height, prot=mmap.PROT_READ, offset=place) as memory:
                data = memory[offset:]
        finally:
            self._call(CLOSE_HANDLE, struct.pack("=II", handle, 0))
        if pitch != width * 4:
            data = b"".join(data[y * pitch:y * pitch + width * 4] for y in range(height))
        return checksum_of(data[0::4], data[1::4], data[2::4])

    def _call(self, request, data):
        return fcntl.ioctl(self._fd, request, data)


def _address_of(space):
    import ctypes
    return ctypes.addressof((ctypes.c_char * len(space)).from_buffer(space))


def look(card):
    """Returns the checksum of the picture on the display; None if it may have changed meanwhile."""
    began = time.monotonic()
    framebuffer = card.framebuffer()
    checksum = card.checksum(framebuffer) if framebuffer else None
    same = card.framebuffer() == framebuffer and time.monotonic() - began < LONGEST_LOOK_S
    return checksum if same else None


def main(path, output):
    card = Card(path)
    # Before the programs under test: decoders that start take the only processor for longer than a frame.
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    last, count, discarded, unseen, looked = None, 0, 0, 0, time.monotonic()
    with open(output, "w") as lines:
        print("looking", flush=True)
        try:
            while True:
                checksum = look(card)
                if checksum is None:
                    discarded += 1
                elif checksum == last:
                    count += 1
                else:
                    if last is not None:
                        lines.write(f"{last:08x} {count} {discarded} {unseen:.2f}\n")
                    last, count, discarded, unseen = checksum, 1, 0, time.monotonic() - looked
                if checksum is not None:
                    looked = time.monotonic()
                time.sleep(1 / LOOKS_PER_SECOND)
        finally:
            if last is not None:
                lines.write(f"{last:08x} {count} {discarded} {unseen:.2f}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
