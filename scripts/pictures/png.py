# SPDX-License-Identifier: Apache-2.0
"""PNG files of at most 256 colours."""

import collections
import heapq
import itertools
import struct
import zlib


def palette_of(counts, size):
    """Median cut: divides the colours into boxes, and returns {colour: index} and the boxes' mean colours."""
    def weighed(box):
        """A heap's entry: the box with the widest and most frequent colours comes first."""
        spreads = [max(column) - min(column) for column in zip(*box)]
        weight = max(spreads) ** 2 * sum(counts[c] for c in box) if len(box) > 1 else 0
        return -weight, next(order), spreads.index(max(spreads)), box

    order = itertools.count()
    heap = [weighed(sorted(counts))]
    while len(heap) < size and heap[0][0] < 0:
        _, _, channel, box = heapq.heappop(heap)
        box.sort(key=lambda c: (c[channel], c))
        half, seen, cut = sum(counts[c] for c in box) / 2, 0, 1
        for cut, colour in enumerate(box[:-1], 1):
            seen += counts[colour]
            if seen >= half:
                break
        heapq.heappush(heap, weighed(box[:cut]))
        heapq.heappush(heap, weighed(box[cut:]))
    boxes = [entry[3] for entry in sorted(heap, key=lambda entry: entry[1])]
    index, palette = {}, bytearray()
    for number, box in enumerate(boxes):
        total = sum(counts[c] for c in box)
        palette += bytes(round(sum(c[k] * counts[c] for c in box) / total) for k in range(3))
        index.update((c, number) for c in box)
    return index, palette


def write_png(picture, path, colours=256, drop=1):
    """Writes an indexed PNG; colours that differ in their lowest `drop` bits only count as one."""
    mask = 0xFF & ~((1 << drop) - 1)
    data = picture.pixels
    keys = list(zip(*((code & mask for code in data[channel::3]) for channel in range(3))))
    index, palette = palette_of(collections.Counter(keys), colours)
    width = picture.width
    rows = b"".join(b"\0" + bytes(index[key] for key in keys[y * width:(y + 1) * width])
                    for y in range(picture.height))

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, picture.height, 8, 3, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"PLTE", bytes(palette)) +
                     chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))
