# SPDX-License-Identifier: Apache-2.0
"""Pictures of pixels as arrays (rows, columns, 3): changes of scale, and sheets of several pictures.

A mean of pixels is taken in linear light.
"""

import struct

import numpy
from PIL import Image, ImageDraw, ImageFont

BACKGROUND = (32, 33, 36)
FONT = ImageFont.truetype("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", 15)


def read(path):
    return numpy.array(Image.open(path).convert("RGB"))


def read_xwd(path):
    """Reads a dump of a screen of 24 bits, as Xvfb keeps it in a file."""
    data = path.read_bytes()
    word = struct.unpack(">25I", data[:100])
    header, width, height, bytes_per_row, colours = word[0], word[4], word[5], word[12], word[19]
    rows = numpy.frombuffer(data, numpy.uint8, height * bytes_per_row, header + 12 * colours)
    return rows.reshape(height, -1, 4)[:, :width, 2::-1].copy()


def crop(picture, x, y, width, height):
    return picture[y:y + height, x:x + width]


def outline(picture, x, y, width, height, colour=(255, 255, 255)):
    """Draws into the picture."""
    picture[[y, y + height - 1], x:x + width] = colour
    picture[y:y + height, [x, x + width - 1]] = colour


def squares(picture, factor):
    """Returns the picture as (rows, columns, factor * factor, 3): its squares of pixels."""
    height, width = (n // factor for n in picture.shape[:2])
    cells = picture[:height * factor, :width * factor].reshape(height, factor, width, factor, 3)
    return cells.swapaxes(1, 2).reshape(height, width, factor * factor, 3)


def smaller(picture, factor):
    """Averages squares of factor x factor pixels in linear light."""
    value = squares(picture, factor) / 255
    light = numpy.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).mean(axis=2)
    code = numpy.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return (255 * code).round().astype(numpy.uint8)


def brightest(picture, factor):
    """Keeps the brightest of factor x factor pixels, so that single pixels of an error map stay visible."""
    cells = squares(picture, factor)
    place = (cells @ numpy.array((2, 3, 1))).argmax(axis=2)
    return numpy.take_along_axis(cells, place[..., None, None], axis=2)[:, :, 0]


def larger(picture, factor):
    """Repeats each pixel factor x factor times."""
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)


def subpixels(picture, scale):
    """Draws each pixel as its red, green and blue stripes, scale pixels high; scale is a multiple of 3."""
    enlarged = larger(picture, scale)
    stripe = numpy.arange(enlarged.shape[1]) // (scale // 3) % 3
    enlarged[:, stripe[:, None] != numpy.arange(3)] = 0
    enlarged[scale - 1::scale] = 0
    return enlarged


def sheet(rows, gap=10):
    """Puts rows of (label, picture) on one page; the label stands above its picture."""
    label_height = 26
    width = max(sum(p.shape[1] + gap for _, p in row) for row in rows) + gap
    height = sum(max(p.shape[0] for _, p in row) + label_height + gap for row in rows)
    page = Image.new("RGB", (width, height), BACKGROUND)
    draw = ImageDraw.Draw(page)
    y = 0
    for row in rows:
        x = gap
        for label, picture in row:
            draw.text((x, y + 5), label, (236, 236, 236), FONT)
            page.paste(Image.fromarray(picture), (x, y + label_height))
            x += picture.shape[1] + gap
        y += label_height + max(p.shape[0] for _, p in row) + gap
    return numpy.array(page)


def write(made, path):
    """Writes a picture without loss, or several as an animation that goes there and back."""
    if isinstance(made, list):
        frames = [Image.fromarray(frame) for frame in made + made[-2:0:-1]]
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=80, loop=0, quality=85)
    else:
        Image.fromarray(made).save(path, optimize=True)
