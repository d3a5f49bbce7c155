#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A renderer that implements docs/content/ring.md by itself.

    ring_renderer.py SOCKET FRAMES FINGERPRINT    `lenticule rig show` prints the fingerprint

    ring_renderer.py SOCKET FRAMES views          for a player of views: play ring:SOCKET --grid 8x6

Byte x of row y of frame n is x + 3 y + 7 n, modulo 256; of view k, 40 k more. Needs only Python 3.9 and, for atomic
operations, the libatomic.so.1 of gcc.
"""

import ctypes
import fcntl
import mmap
import os
import select
import socket
import struct
import sys

MAGIC, VERSION = 0x474E524C, 1
HELLO, ACCEPT, REFUSE, WANTED, GOODBYE = 1, 2, 3, 4, 6
FREE, WRITING, READY = 1, 2, 3
HEADER = struct.Struct("=8s6I7Q")
CONTENT = struct.Struct("=IHHHHId8H")
ACQUIRE, RELEASE, RELAXED = 2, 3, 0  # __ATOMIC_ACQUIRE and so on
F_GET_SEALS, F_SEAL_SHRINK = 1034, 0x0002

atomic = ctypes.CDLL("libatomic.so.1")
compare_exchange = getattr(atomic, "__atomic_compare_exchange_4")
compare_exchange.restype = ctypes.c_bool
compare_exchange.argtypes = [
    ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int, ctypes.c_int]
fetch_add = getattr(atomic, "__atomic_fetch_add_4")
fetch_add.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int]


def message(kind, body=b""):
    return struct.pack("=4I", MAGIC, VERSION, kind, 16 + len(body)) + body


def change(address, before, after, order):
    """Replaces `before` by `after` atomically; returns False if the value is another one."""
    expected = ctypes.c_uint32(before)
    return compare_exchange(address, ctypes.byref(expected), after, order, RELAXED)


class Ring:
    def __init__(self, path, frames, fingerprint, views):
        self.player = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.player.connect(path)
        body = struct.pack("=64s128sqqQII", b"ring_renderer.py", fingerprint.encode(), 60, 1,
                           frames, 1, views)
        self.player.send(message(HELLO, body))
        answer, fds, _, _ = socket.recv_fds(self.player, 257, 2)
        kind = struct.unpack_from("=4I", answer)[2]
        if kind == REFUSE:
            sys.exit("refused: " + answer[24:].split(b"\0")[0].decode())
        if kind != ACCEPT or len(fds) != 2:
            sys.exit("the peer is not a lenticule player")
        memory, self.published = fds
        size, self.epoch = struct.unpack_from("=QI", answer, 16)
        if not fcntl.fcntl(memory, F_GET_SEALS) & F_SEAL_SHRINK or os.fstat(memory).st_size != size:
            sys.exit("the memory is not sealed, or its size differs from the announced one")
        self.memory = mmap.mmap(memory, size)
        (magic, abi, endian, self.slots, pixels, self.width, self.height, self.row_bytes,
         self.frame_bytes, self.table, self.entry_bytes, self.first, self.stride,
         _) = HEADER.unpack_from(self.memory)
        if (magic, abi, endian, pixels) != (b"LNTCRING", 1, 0x01020304, 1):
            sys.exit("the ring has another version or pixel format")
        self.base = ctypes.addressof(ctypes.c_char.from_buffer(self.memory))
        self.order = 0

    def places(self):
        """Returns left, top, width and height of each view, from the leftmost camera's on."""
        (kind, columns, rows, views, rightmost_first, _, _,
         *rects) = CONTENT.unpack_from(self.memory, HEADER.size)
        if kind == 0:
            return [(0, 0, self.width, self.height)]
        if kind == 2:  # colours and depth
            return [tuple(rects[:4]), tuple(rects[4:])]
        width, height = self.width // columns, self.height // rows
        tiles = range(views)[::-1] if rightmost_first else range(views)
        return [(tile % columns * width, self.height - (tile // columns + 1) * height, width, height)
                for tile in tiles]

    def entry(self, slot):
        return self.table + slot * self.entry_bytes

    def word(self, state):
        return self.epoch << 3 | state

    def acquire(self):
        """Takes a free slot and returns its number. Waits until the player frees one."""
        asked = False
        while True:
            for slot in range(self.slots):
                address = self.base + self.entry(slot)
                if change(address, self.word(FREE), self.word(WRITING), ACQUIRE):
                    return slot
            if not asked:
                self.player.send(message(WANTED))
                asked = True
            if select.select([self.player], [], [], 0.1)[0] and not self.player.recv(257):
                sys.exit("the player has ended")

    def write(self, slot, frame):
        begin = self.first + slot * self.stride
        self.memory[begin:begin + self.frame_bytes] = frame

    def publish(self, slot, number):
        at = self.entry(slot)
        struct.pack_into("=QQ", self.memory, at + 8, number, self.order)
        if not change(self.base + at, self.word(WRITING), self.word(READY), RELEASE):
            sys.exit("the player has withdrawn the slot")
        self.order += 1
        os.write(self.published, struct.pack("=Q", 1))
        fetch_add(self.base + 192, 1, RELAXED)

    def finish(self):
        self.player.send(message(GOODBYE, struct.pack("=Q", self.order)))


def drawn(ring, number):
    """Returns the bytes of a frame."""
    frame = bytearray(ring.frame_bytes)
    for view, (left, top, width, height) in enumerate(ring.places()):
        for y in range(height):
            begin = (top + y) * ring.row_bytes + 3 * left
            frame[begin:begin + 3 * width] = bytes(
                (x + 3 * y + 40 * view + 7 * number) % 256 for x in range(3 * width))
    return frame


def main():
    if len(sys.argv) != 4:
        sys.exit("usage: ring_renderer.py SOCKET FRAMES FINGERPRINT|views")
    frames, views = int(sys.argv[2]), sys.argv[3] == "views"
    ring = Ring(sys.argv[1], frames, "" if views else sys.argv[3], views)
    for number in range(frames):
        slot = ring.acquire()
        ring.write(slot, drawn(ring, number))
        ring.publish(slot, number)
    ring.finish()


if __name__ == "__main__":
    main()
