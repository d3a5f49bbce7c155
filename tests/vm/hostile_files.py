# SPDX-License-Identifier: Apache-2.0
"""Bytes of picture files, sound and lying, for the hostile playlist. Needs no other program."""

import random
import struct
import zlib

import picture


def blocks(width, height, seed):
    """Returns squares of random colours with a row of noise: no other seed has the same pixels, and
    every codec is fast."""
    side, source = 20, random.Random(seed)
    rows = []
    for top in range(0, height, side):
        row = b"".join(source.randbytes(3) * side for _ in range(0, width, side))[:width * 3]
        rows += [row] * min(side, height - top)
    rows[height // 2] = source.randbytes(width * 3)
    return picture.Picture(width, height, b"".join(rows))


def grey(width, height, code):
    return picture.Picture(width, height, bytes([code]) * (width * height * 3))


def rows_of(shown):
    stride = shown.width * 3
    return [shown.rgb[at:at + stride] for at in range(0, len(shown.rgb), stride)]


def bgr(shown):
    """Returns the rows with blue first."""
    rows = []
    for row in rows_of(shown):
        turned = bytearray(row)
        turned[0::3], turned[2::3] = row[2::3], row[0::3]
        rows.append(bytes(turned))
    return rows


# -- PNG -------------------------------------------------------------------------------------------

def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_of(width, height, compressed):
    """Returns a PNG whose header states this size. The data may be of another size."""
    header = struct.pack(">IIBBBBB", width & 0xFFFFFFFF, height & 0xFFFFFFFF, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", compressed)
            + chunk(b"IEND", b""))


def png(shown):
    raw = b"".join(b"\0" + row for row in rows_of(shown))
    return png_of(shown.width, shown.height, zlib.compress(raw, 1))


def png_bomb(width, height):
    """Returns a small file of a black picture that is as large as stated. height: whole hundreds."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    hundred_rows = packer.compress(bytes((1 + width * 3) * 100)) + packer.flush(zlib.Z_FULL_FLUSH)
    count = (1 + width * 3) * height
    last_block, checksum = b"\3\0", struct.pack(">HH", count % 65521, 1)
    return png_of(width, height,
                  b"\x78\xda" + hundred_rows * (height // 100) + last_block + checksum)


# -- JPEG ------------------------------------------------------------------------------------------

def jpeg(width, height, blocks_of_data, end=b"\xff\xd9"):
    """Returns a baseline JPEG of one value, 128, with the data of that many blocks of 8 x 8."""
    code_of_zero = bytes([1] + [0] * 15) + b"\0"  # the only code is the bit 0, for the value 0
    header = (b"\xff\xd8\xff\xdb\0\x43\0" + b"\1" * 64
              + b"\xff\xc0\0\x0b\x08" + struct.pack(">HH", height, width) + b"\1\1\x11\0"
              + b"\xff\xc4\0\x14\x00" + code_of_zero + b"\xff\xc4\0\x14\x10" + code_of_zero
              + b"\xff\xda\0\x08\1\1\0\0\x3f\0")
    bits = "00" * blocks_of_data
    bits += "1" * (-len(bits) % 8)
    return header + int(bits, 2).to_bytes(len(bits) // 8, "big") + end


# -- other formats ---------------------------------------------------------------------------------

def ppm_of(width, height, data):
    return b"P6\n%d %d\n255\n" % (width, height) + data


def bmp_of(width, height, data):
    size = 54 + len(data)
    return (b"BM" + struct.pack("<IHHI", size, 0, 0, 54)
            + struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, len(data), 2835, 2835, 0, 0)
            + data)


def bmp(shown):
    padding = bytes(-shown.width * 3 % 4)
    return bmp_of(shown.width, shown.height,
                  b"".join(row + padding for row in reversed(bgr(shown))))


def tga_of(width, height, data):
    from_the_top = 0x20
    return struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, width, height, 24,
                       from_the_top) + data


def tga(shown):
    return tga_of(shown.width, shown.height, b"".join(bgr(shown)))


def tiff_of(width, height, data, stated_bytes=None):
    bits_at, data_at = 8, 16
    tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 3, bits_at), (259, 3, 1, 1),
            (262, 3, 1, 2), (273, 4, 1, data_at), (277, 3, 1, 3), (278, 4, 1, height),
            (279, 4, 1, len(data) if stated_bytes is None else stated_bytes)]
    directory = struct.pack("<H", len(tags)) + b"".join(
        struct.pack("<HHII", *tag) for tag in tags) + bytes(4)
    return (b"II*\0" + struct.pack("<I", data_at + len(data)) + struct.pack("<HHHxx", 8, 8, 8)
            + data + directory)


def tiff(shown):
    return tiff_of(shown.width, shown.height, shown.rgb)


def exr_of(width, height, lines):
    """Returns an uncompressed EXR of floats that states this size. lines: bytes per scan line."""
    def attribute(name, kind, data):
        return name + b"\0" + kind + b"\0" + struct.pack("<I", len(data)) + data
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<IB3xII", 2, 0, 1, 1)
                        for name in (b"B", b"G", b"R")) + b"\0"
    header = (b"\x76\x2f\x31\x01\x02\0\0\0" + attribute(b"channels", b"chlist", channels)
              + attribute(b"compression", b"compression", b"\0")
              + attribute(b"dataWindow", b"box2i", window)
              + attribute(b"displayWindow", b"box2i", window)
              + attribute(b"lineOrder", b"lineOrder", b"\0")
              + attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
              + attribute(b"screenWindowCenter", b"v2f", struct.pack("<ff", 0, 0))
              + attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)) + b"\0")
    offset, offsets, body = len(header) + 8 * len(lines), [], []
    for y, line in enumerate(lines):
        offsets.append(struct.pack("<Q", offset))
        body.append(struct.pack("<iI", y, len(line)) + line)
        offset += len(body[-1])
    return header + b"".join(offsets) + b"".join(body)


def linear(code):
    value = code / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def exr(shown):
    floats = [struct.pack("<f", linear(code)) for code in range(256)]
    lines = []
    for row in rows_of(shown):
        lines.append(b"".join(floats[code] for channel in (2, 1, 0) for code in row[channel::3]))
    return exr_of(shown.width, shown.height, lines)
