# SPDX-License-Identifier: Apache-2.0
"""Pictures as plain bytes: reading PPM and PNG, comparing pixel by pixel, test patterns."""

import dataclasses
import itertools
import pathlib
import random
import struct
import zlib


@dataclasses.dataclass(frozen=True)
class Picture:
    """rgb holds height rows of width pixels of 3 bytes: red, green, blue; no padding."""

    width: int
    height: int
    rgb: bytes

    def __post_init__(self):
        if len(self.rgb) != self.width * self.height * 3:
            raise ValueError(f"{self.width}x{self.height} needs {self.width * self.height * 3} "
                             f"bytes, not {len(self.rgb)}")

    def pixel(self, x, y):
        at = (y * self.width + x) * 3
        return tuple(self.rgb[at:at + 3])

    def with_pixel(self, x, y, colour):
        """Returns the picture with one pixel changed."""
        at = (y * self.width + x) * 3
        return Picture(self.width, self.height, self.rgb[:at] + bytes(colour) + self.rgb[at + 3:])

    def ppm(self):
        return b"P6\n%d %d\n255\n" % (self.width, self.height) + self.rgb


def differing_pixels(one, other):
    """Returns how many pixels differ; all of the larger picture if the sizes differ."""
    if (one.width, one.height) != (other.width, other.height):
        return max(one.width * one.height, other.width * other.height)
    stride = one.width * 3
    count = 0
    for start in range(0, len(one.rgb), stride):
        row, other_row = one.rgb[start:start + stride], other.rgb[start:start + stride]
        if row != other_row:
            count += sum(row[at:at + 3] != other_row[at:at + 3] for at in range(0, stride, 3))
    return count


def describe_difference(one, other):
    """Returns a line of text: sizes, count and the first differing pixel."""
    if (one.width, one.height) != (other.width, other.height):
        return f"sizes differ: {one.width}x{one.height} and {other.width}x{other.height}"
    at = next((i for i, (a, b) in enumerate(zip(one.rgb, other.rgb)) if a != b), None)
    if at is None:
        return "identical"
    y, x = divmod(at // 3, one.width)
    return (f"{differing_pixels(one, other)} of {one.width * one.height} pixels differ, first at "
            f"x={x} y={y}: {one.pixel(x, y)} and {other.pixel(x, y)}")


def assert_same(seen, expected):
    """Fails with the place of the first difference unless all pixels are equal."""
    if seen != expected:
        raise AssertionError(describe_difference(seen, expected))


def noise(width, height, seed):
    """Returns random subpixels, which reveal any shift, swap or scaling."""
    return Picture(width, height, random.Random(seed).randbytes(width * height * 3))


def combined(one, other):
    """Returns the bitwise exclusive or: with noise no region of a picture is flat."""
    size = len(one.rgb)
    bits = int.from_bytes(one.rgb, "big") ^ int.from_bytes(other.rgb, "big")
    return Picture(one.width, one.height, bits.to_bytes(size, "big"))


def read(path):
    """Reads a PPM (P6, 8 bits) or PNG (8 bits, RGB or RGBA, not interlaced) file."""
    data = pathlib.Path(path).read_bytes()
    return from_png(data) if data.startswith(b"\x89PNG") else from_ppm(data)


def from_ppm(data):
    fields, at = [], 0
    while len(fields) < 4:
        while data[at:at + 1].isspace():
            at += 1
        if data[at:at + 1] == b"#":
            at = data.index(b"\n", at)
            continue
        end = at
        while not data[end:end + 1].isspace():
            end += 1
            if end > len(data):
                raise ValueError("the PPM header ends early")
        fields.append(data[at:end])
        at = end
    if fields[0] != b"P6" or fields[3] != b"255":
        raise ValueError(f"not a PPM of 8 bits: {b' '.join(fields)!r}")
    return Picture(int(fields[1]), int(fields[2]), data[at + 1:])


def from_png(data):
    chunks, at = {}, 8
    while at + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        chunks[kind] = chunks.get(kind, b"") + data[at + 8:at + 8 + length]
        at += 12 + length
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    if depth != 8 or colour not in (2, 6) or interlaced:
        raise ValueError("only PNG of 8 bits, RGB or RGBA, not interlaced, is read here")
    channels = 3 if colour == 2 else 4
    pixels = _unfiltered(zlib.decompress(chunks[b"IDAT"]), width * channels, height, channels)
    if channels == 4:
        rgb = bytearray(width * height * 3)
        for channel in range(3):
            rgb[channel::3] = pixels[channel::4]
        pixels = bytes(rgb)
    return Picture(width, height, pixels)


def _unfiltered(data, stride, height, channels):
    rows, above = [], bytes(stride)
    for start in range(0, height * (stride + 1), stride + 1):
        above = _UNFILTER[data[start]](data[start + 1:start + 1 + stride], above, channels)
        rows.append(above)
    return b"".join(rows)


def _row_none(row, _above, _channels):
    return row


def _row_sub(row, _above, channels):
    result = bytearray(len(row))
    for channel in range(channels):
        sums = itertools.accumulate(row[channel::channels])
        result[channel::channels] = bytes(value & 255 for value in sums)
    return bytes(result)


def _row_up(row, above, _channels):
    return bytes((a + b) & 255 for a, b in zip(row, above))


def _row_average(row, above, channels):
    result = bytearray(row)
    for i, up in enumerate(above):
        left = result[i - channels] if i >= channels else 0
        result[i] = (row[i] + (left + up) // 2) & 255
    return bytes(result)


def _row_paeth(row, above, channels):
    result = bytearray(row)
    for i, up in enumerate(above):
        left = result[i - channels] if i >= channels else 0
        corner = above[i - channels] if i >= channels else 0
        guess = left + up - corner
        nearest = min((abs(guess - left), 0, left), (abs(guess - up), 1, up),
                      (abs(guess - corner), 2, corner))
        result[i] = (row[i] + nearest[2]) & 255
    return bytes(result)


_UNFILTER = [_row_none, _row_sub, _row_up, _row_average, _row_paeth]
