# SPDX-License-Identifier: Apache-2.0
"""Pictures of pixels in memory: the files that lenticule and Xvfb write, and changes of scale.

A mean of pixels is taken in linear light.
"""

import re
import struct

BACKGROUND = (32, 33, 36)


class Picture:
    """Pixels of 8-bit RGB, row by row from the top."""

    def __init__(self, width, height, pixels=None):
        self.width, self.height = width, height
        self.pixels = pixels if pixels is not None else bytearray(bytes(BACKGROUND) * (width * height))

    def row(self, y, begin=0, end=None):
        end = self.width if end is None else end
        return self.pixels[3 * (y * self.width + begin):3 * (y * self.width + end)]

    def crop(self, x, y, width, height):
        rows = (self.row(j, x, x + width) for j in range(y, y + height))
        return Picture(width, height, bytearray().join(rows))

    def paste(self, other, x, y):
        for j in range(other.height):
            begin = 3 * ((y + j) * self.width + x)
            self.pixels[begin:begin + 3 * other.width] = other.row(j)

    def fill(self, x, y, width, height, colour):
        for j in range(y, y + height):
            begin = 3 * (j * self.width + x)
            self.pixels[begin:begin + 3 * width] = bytes(colour) * width

    def outline(self, x, y, width, height, colour, thickness=1):
        self.fill(x, y, width, thickness, colour)
        self.fill(x, y + height - thickness, width, thickness, colour)
        self.fill(x, y, thickness, height, colour)
        self.fill(x + width - thickness, y, thickness, height, colour)


def read_ppm(path):
    """Reads a binary PPM file without comments, as lenticule writes them."""
    data = path.read_bytes()
    header = re.match(rb"P6\s+(\d+)\s+(\d+)\s+255\s", data)
    width, height = int(header.group(1)), int(header.group(2))
    return Picture(width, height, bytearray(data[header.end():header.end() + 3 * width * height]))


def read_xwd(path):
    """Reads a dump of a screen of 24 bits, as Xvfb keeps it in a file."""
    data = path.read_bytes()
    word = struct.unpack(">25I", data[:100])
    header, width, height, bytes_per_row, colours = word[0], word[4], word[5], word[12], word[19]
    picture = Picture(width, height)
    begin = header + 12 * colours
    for y in range(height):
        row = data[begin + y * bytes_per_row:begin + y * bytes_per_row + 4 * width]
        for channel in range(3):
            picture.pixels[3 * y * width + channel:3 * (y + 1) * width:3] = row[2 - channel::4]
    return picture


def _linear(code):
    value = code / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


LINEAR = [round(65535 * _linear(code)) for code in range(256)]
CODES = bytearray()
for _light in range(4096):
    _value = _light / 4095
    _value = 12.92 * _value if _value <= 0.0031308 else 1.055 * _value ** (1 / 2.4) - 0.055
    CODES.append(round(255 * _value))


def smaller(picture, factor):
    """Averages squares of factor x factor pixels in linear light."""
    width, height = picture.width // factor, picture.height // factor
    out = bytearray()
    share = 4095 / (65535 * factor * factor)
    for y in range(height):
        rows = [picture.row(factor * y + j, 0, width * factor) for j in range(factor)]
        sums = [[0] * width for _ in range(3)]
        for row in rows:
            for c in range(3):
                light = [LINEAR[code] for code in row[c::3]]
                for i in range(factor):
                    sums[c] = list(map(int.__add__, sums[c], light[i::factor]))
        line = bytearray(3 * width)
        for c in range(3):
            line[c::3] = bytes(CODES[round(s * share)] for s in sums[c])
        out += line
    return Picture(width, height, out)


def brightest(picture, factor):
    """Keeps the brightest of factor x factor pixels, so that single pixels of an error map stay visible."""
    width, height = picture.width // factor, picture.height // factor
    out = bytearray()
    for y in range(height):
        rows = [picture.row(factor * y + j) for j in range(factor)]
        for x in range(width):
            places = range(3 * factor * x, 3 * factor * (x + 1), 3)
            cell = [row[i:i + 3] for row in rows for i in places]
            out += max(cell, key=lambda p: 2 * p[0] + 3 * p[1] + p[2])
    return Picture(width, height, out)


def larger(picture, factor):
    """Repeats each pixel factor x factor times."""
    out = bytearray()
    for y in range(picture.height):
        row = picture.row(y)
        line = b"".join(bytes(row[3 * x:3 * x + 3]) * factor for x in range(picture.width))
        out += line * factor
    return Picture(picture.width * factor, picture.height * factor, out)


def nearest(picture, numerator, denominator):
    """Scales by numerator/denominator without mixing pixels."""
    width, height = (n * numerator // denominator for n in (picture.width, picture.height))
    out = bytearray()
    for y in range(height):
        row = picture.row(y * denominator // numerator)
        for x in range(width):
            i = 3 * (x * denominator // numerator)
            out += row[i:i + 3]
    return Picture(width, height, out)


def subpixels(picture, scale):
    """Draws each pixel as its red, green and blue stripes, scale pixels high; scale is a multiple of 3."""
    stripe = scale // 3
    out = bytearray()
    for y in range(picture.height):
        line = bytearray()
        for x in range(picture.width):
            red, green, blue = picture.row(y, x, x + 1)
            for colour in ((red, 0, 0), (0, green, 0), (0, 0, blue)):
                line += bytes(colour) * stripe
        out += line * (scale - 1) + bytes(len(line))
    return Picture(picture.width * scale, picture.height * scale, out)
