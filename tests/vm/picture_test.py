# SPDX-License-Identifier: Apache-2.0
"""Tests picture.py, on which the other tests rely. Needs no machine."""

import random
import struct
import unittest
import zlib

import picture


def filtered(kind, row, above, channels):
    """Returns a PNG row filtered byte by byte by the format's definition."""
    result = bytearray([kind])
    for i, value in enumerate(row):
        a = row[i - channels] if i >= channels else 0
        b = above[i]
        c = above[i - channels] if i >= channels else 0
        p = a + b - c
        pa, pb, pc = abs(p - a), abs(p - b), abs(p - c)
        paeth = a if pa <= pb and pa <= pc else b if pb <= pc else c
        guess = [0, a, b, (a + b) // 2, paeth][kind]
        result.append((value - guess) & 255)
    return bytes(result)


def png(width, height, channels, pixels):
    """Returns a PNG whose rows use the five filters in turn."""
    stride, rows, above = width * channels, b"", bytes(width * channels)
    for y in range(height):
        row = pixels[y * stride:(y + 1) * stride]
        rows += filtered(y % 5, row, above, channels)
        above = row

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    data = zlib.compress(rows)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data[:50])
            + chunk(b"IDAT", data[50:]) + chunk(b"IEND", b""))


class Pictures(unittest.TestCase):
    def test_png_rows_of_every_filter_are_read(self):
        shown = picture.noise(17, 11, seed=1)
        self.assertEqual(picture.from_png(png(17, 11, 3, shown.rgb)), shown)

    def test_alpha_of_a_png_is_left_out(self):
        rgba = random.Random(2).randbytes(13 * 7 * 4)
        read = picture.from_png(png(13, 7, 4, rgba))
        self.assertEqual(read.pixel(5, 3), tuple(rgba[(3 * 13 + 5) * 4:][:3]))

    def test_ppm_survives_a_round_trip_also_where_pixels_look_like_space(self):
        shown = picture.Picture(2, 2, b" \n\t# 0 1 2 3"[:12])
        self.assertEqual(picture.from_ppm(shown.ppm()), shown)
        self.assertEqual(picture.from_ppm(b"P6 # made by hand\n2\t2 255 " + shown.rgb), shown)

    def test_a_cut_ppm_is_refused(self):
        for length in (1, 5, 12, 22):
            with self.assertRaises(ValueError):
                picture.from_ppm(picture.noise(2, 2, seed=1).ppm()[:length])

    def test_each_changed_pixel_is_counted_once(self):
        shown = picture.noise(9, 5, seed=3)
        changed = shown.with_pixel(8, 4, (0, 0, 0)).with_pixel(0, 0, (1, 2, 3))
        self.assertEqual(picture.differing_pixels(shown, changed), 2)
        self.assertIn("2 of 45 pixels differ, first at x=0 y=0",
                      picture.describe_difference(shown, changed))
        with self.assertRaises(AssertionError):
            picture.assert_same(shown, changed)

    def test_another_size_differs_everywhere(self):
        self.assertEqual(picture.differing_pixels(picture.noise(4, 2, 1), picture.noise(2, 4, 1)), 8)


if __name__ == "__main__":
    unittest.main()
