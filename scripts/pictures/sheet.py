# SPDX-License-Identifier: Apache-2.0
"""Sheets: several pictures on one page, each with a label in letters of dots above it."""

from pictures.raster import Picture

# Nine rows of five dots a letter.
GLYPHS = {}
for _line in """
a 00000e010f110f|b 10101e1111111e|c 00000e1110110e|d 01010f1111110f|e 00000e111f100e|f 06081c08080808
g 00000f1111110f010e|h 10101e11111111|i 04000c0404040e|j 0200060202020212 0c|k 10101214181412|l 0c04040404040e
m 00001a15151515|n 00001e11111111|o 00000e1111110e|p 00001e1111111e1010|q 00000f1111110f0101|r 00001619101010
s 00000f100e011e|t 08081c08080906|u 0000111111110f|v 00001111110a04|w 0000111115150a|x 0000110a040a11
y 0000111111110f010e|z 00001f0204081f|0 0e11131519110e|1 040c040404040e|2 0e11010204081f|3 1f02040201110e
4 02060a121f0202|5 1f101e0101110e|6 0608101e11110e|7 1f010204080808|8 0e11110e11110e|9 0e11110f01020c
- 00000000000000|. 00000000000c0c|, 00000000000c0408|= 00001f001f0000|/ 01020204080810|( 02040808080402
) 08040202020408|+ 0004041f040400|E 1f10101e10101f|K 11121418141211|% 18190204081303|B 1e11111e11111e
""".split("\n"):
    for _glyph in filter(None, _line.split("|")):
        _hex = _glyph[2:].replace(" ", "")
        GLYPHS[_glyph[0]] = [int(_hex[k:k + 2], 16) for k in range(0, len(_hex), 2)]
GLYPHS["-"] = [0, 0, 0, 0x0E]
GLYPHS[" "] = []


def write(picture, x, y, text, colour=(236, 236, 236)):
    """Writes text with its top-left corner at (x, y), dots of two pixels."""
    for letter in text:
        for j, dots in enumerate(GLYPHS[letter]):
            for i in range(5):
                if dots & (16 >> i):
                    picture.fill(x + 2 * i, y + 2 * j, 2, 2, colour)
        x += 12


def sheet(rows, gap=10):
    """Puts rows of (label, picture) on one page; the label stands above its picture."""
    label_height = 26
    width = max(sum(p.width for _, p in row) + gap * (len(row) - 1) for row in rows) + 2 * gap
    height = sum(max(p.height for _, p in row) + label_height for row in rows) + gap * len(rows)
    page = Picture(width, height)
    y = 0
    for row in rows:
        x = gap
        for label, picture in row:
            write(page, x, y + 7, label)
            page.paste(picture, x, y + label_height)
            x += picture.width + gap
        y += label_height + max(p.height for _, p in row) + gap
    return page
