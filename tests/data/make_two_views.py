#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes two-views.mp4, a film of two views in MV-HEVC as phones and headsets record it.

    tests/data/make_two_views.py PATH/TO/x265

x265 4.1 or later, built with ENABLE_MULTIVIEW, encodes the views; the container is written here, because
common tools do not write the boxes of two views. tests/unit/player/video_two_views_test.cpp draws the same views.
"""
import os
import struct
import subprocess
import sys
import tempfile

WIDTH, HEIGHT, FRAMES, RATE, BLOCK = 64, 48, 12, 25, 8
VPS, SPS, PPS, SEI = 32, 33, 34, 39


def luma(eye, frame, x, y):
    """Returns a block's brightness; the lowest row of blocks is the frame's number in binary."""
    if y == HEIGHT // BLOCK - 1:
        return 200 if frame >> x & 1 else 40
    return 40 + 24 * ((3 * x + 5 * y + 3 * frame + 4 * eye) % 8)


def picture(eye, frame):
    rows = [bytes(luma(eye, frame, x // BLOCK, y // BLOCK) for x in range(WIDTH)) for y in range(HEIGHT)]
    chroma = [bytes([value]) * (WIDTH * HEIGHT // 4) for value in ((150, 100) if eye else (100, 150))]
    return b"".join(rows + chroma)


def encode(x265):
    with tempfile.TemporaryDirectory() as folder:
        for eye, name in enumerate(("left", "right")):
            with open(f"{folder}/{name}.yuv", "wb") as out:
                out.write(b"".join(picture(eye, frame) for frame in range(FRAMES)))
        with open(f"{folder}/views", "w") as out:
            out.write('--num-views 2\n--format 0\n--input "left.yuv"\n--input "right.yuv"\n')
        subprocess.run([os.path.abspath(x265), "--multiview-config", "views", "--input-res", f"{WIDTH}x{HEIGHT}",
                        "--fps", str(RATE), "--input-csp", "i420", "--qp", "14", "--ctu", "16", "--no-info",
                        "--bframes", "2", "--b-adapt", "0", "--keyint", "6", "--min-keyint", "6",
                        "--frame-threads", "1", "-o", "film.hevc"], cwd=folder, check=True)
        with open(f"{folder}/film.hevc", "rb") as film:
            return film.read()


def units(stream):
    """Returns the NAL units: (type, layer, bytes)."""
    parts = [part.rstrip(b"\0") for part in stream.split(b"\0\0\1")[1:]]
    return [(p[0] >> 1 & 63, (p[0] & 1) << 5 | p[1] >> 3, p) for p in parts]


def order_count(kind, unit):
    """Returns the place in display order since the last IDR picture, modulo 256 (slice_pic_order_cnt_lsb)."""
    if kind in (19, 20):
        return 0
    bits = "".join(f"{byte:08b}" for byte in unit[2:].replace(b"\0\0\3", b"\0\0"))
    at = 2 if kind >= 16 else 1
    for extra in (2, 0):  # the number of the PPS and two reserved bits; then the type of the slice
        at += 2 * (bits.index("1", at) - at) + 1 + extra
    return int(bits[at:at + 8], 2)


def box(kind, *contents):
    content = b"".join(contents)
    return struct.pack(">I", len(content) + 8) + kind + content


def full_box(kind, *contents):
    return box(kind, bytes(4), *contents)


def numbers(*values):
    return struct.pack(f">{len(values)}I", *values)


def arrays(sets):
    return bytes([len(sets)]) + b"".join(bytes([0x80 | kind, 0, 1]) + struct.pack(">H", len(unit)) + unit
                                         for kind, unit in sets)


def film(stream):
    samples, places, keys, sets, start, complete = [], [], [], {}, 0, True
    for kind, layer, unit in units(stream):
        if kind in (VPS, SPS, PPS):
            sets.setdefault((layer, kind), unit)
            continue
        if layer == 0 and complete:
            samples.append([])
        complete = kind < VPS
        samples[-1].append(unit)
        if layer > 0 or not complete:
            continue
        if kind in (19, 20):
            start = len(places)
        if 16 <= kind <= 21:
            keys.append(len(samples))
        places.append(start + order_count(kind, unit))
    data = [b"".join(struct.pack(">I", len(unit)) + unit for unit in sample) for sample in samples]
    assert len(data) == len(places) == FRAMES and sorted(places) == list(range(FRAMES))
    delay = max(k - place for k, place in enumerate(places))
    profile = sets[0, SPS].replace(b"\0\0\3", b"\0\0")[3:15]
    head = b"\1" + profile + b"\xf0\0\xfc\xfd\xf8\xf8\0\0\x0f"
    base = [(kind, sets[0, kind]) for kind in (VPS, SPS, PPS)]
    second = [(kind, sets[1, kind]) for kind in (SPS, PPS)]
    entry = box(b"hvc1", bytes(6), b"\0\1", bytes(16), struct.pack(">HH", WIDTH, HEIGHT),
                numbers(0x480000, 0x480000, 0), b"\0\1", bytes(32), b"\0\x18\xff\xff",
                box(b"hvcC", head, arrays(base)), box(b"lhvC", b"\1\xf0\0\xfc\xcf", arrays(second)),
                box(b"vexu", box(b"eyes", full_box(b"stri", b"\3"), full_box(b"hero", b"\1"))))
    matrix = numbers(0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)

    def movie(offset):
        table = box(b"stbl", full_box(b"stsd", numbers(1), entry), full_box(b"stts", numbers(1, FRAMES, 1)),
                    full_box(b"ctts", numbers(FRAMES), *(numbers(1, place - k + delay)
                                                         for k, place in enumerate(places))),
                    full_box(b"stss", numbers(len(keys), *keys)), full_box(b"stsc", numbers(1, 1, FRAMES, 1)),
                    full_box(b"stsz", numbers(0, FRAMES, *map(len, data))), full_box(b"stco", numbers(1, offset)))
        references = full_box(b"dref", numbers(1), box(b"url ", b"\0\0\0\1"))
        media = box(b"mdia", full_box(b"mdhd", numbers(0, 0, RATE, FRAMES), b"\x55\xc4\0\0"),
                    full_box(b"hdlr", bytes(4), b"vide", bytes(13)),
                    box(b"minf", box(b"vmhd", b"\0\0\0\1", bytes(8)), box(b"dinf", references), table))
        header = box(b"tkhd", b"\0\0\0\3", numbers(0, 0, 1, 0, FRAMES, 0, 0, 0, 0), matrix,
                     numbers(WIDTH << 16, HEIGHT << 16))
        edit = box(b"edts", full_box(b"elst", numbers(1, FRAMES, delay, 0x10000)))
        return box(b"moov", full_box(b"mvhd", numbers(0, 0, RATE, FRAMES, 0x10000), bytes(12), matrix, bytes(24),
                                     numbers(2)), box(b"trak", header, edit, media))

    kind = box(b"ftyp", b"isom", bytes(4), b"isomhvc1")
    return kind + movie(len(kind) + len(movie(0)) + 8) + box(b"mdat", *data)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "two-views.mp4"), "wb") as out:
        out.write(film(encode(sys.argv[1])))
