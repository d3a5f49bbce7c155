# SPDX-License-Identifier: Apache-2.0
"""Diagrams of the optics and of the render methods.

Each function returns an SVG picture; it is called with a Studio, which it does not need.
"""

import itertools
import math

from pictures.rigs import KIOSK_4K, numbers_of
from pictures.svg import BLUE, GREY, ORANGE, PALE, Axes, Drawing


def optics_ray(_):
    """From a subpixel through its lens to an eye: the panel from above."""
    pitch, glass, gap, distance, middle, lens_y = 110, 84, 56, 270, 380, 340
    pixel_y, eye_y = lens_y + glass, lens_y - distance
    lenses = [middle + pitch * k for k in range(-2, 3)]
    # The micro-images of the design eye in the middle: farther apart than the lenses.
    stripe = pitch * (1 + gap / distance) / 8
    first = middle - 20 * stripe
    picture = Drawing()
    picture.box(40, lens_y, 680, glass, "#dcebf7")
    for n in range(40):
        fill = ("#e8a09a", "#a8d5a2", "#a3b8e8")[n % 3]
        picture.box(first + n * stripe, pixel_y, stripe, 18, fill, "#fff", 0.7)
    for x in lenses:
        picture.lens(x, lens_y, pitch / 2, 17)
    picture.line((40, eye_y), (720, eye_y), colour=GREY, dashed=True)
    picture.line((40, lens_y), (720, lens_y), colour=GREY, dashed=True)
    for eye, colour in ((middle - 105, ORANGE), (middle + 105, BLUE)):
        for x in lenses:
            behind = x - gap * (eye - x) / distance
            picture.line((eye, eye_y), (x, lens_y), (behind, pixel_y), colour=colour, width=1.6)
            subpixel = first + math.floor((behind - first) / stripe) * stripe
            picture.box(subpixel, pixel_y, stripe, 18, "none", colour, 2.5)
        picture.dot(eye, eye_y, 8, "#fff", colour)
    picture.text(44, eye_y - 8, "viewing line, z = Z")
    picture.text(middle - 111, eye_y - 16, "left eye", "middle")
    picture.text(middle + 111, eye_y - 16, "right eye E", "middle")
    picture.text(44, lens_y - 8, "panel plane, z = 0")
    picture.text(lenses[3] + 8, lens_y - 10, "lens point L")
    picture.text(44, pixel_y + 34, "pixels")
    picture.text(lenses[3], pixel_y + 34, "subpixel Q", "middle")
    picture.span((738, lens_y), (738, pixel_y))
    picture.text(750, lens_y + 46, "t")
    picture.span((middle - pitch / 2, lens_y - 30), (middle + pitch / 2, lens_y - 30))
    picture.text(middle, lens_y - 36, "lens pitch", "middle")
    picture.arrow((70, 250), (70, 200))
    picture.text(78, 206, "z")
    picture.arrow((70, 250), (120, 250))
    picture.text(124, 254, "x")
    return picture.finish(770, pixel_y + 50)


def optics_views(_):
    """Which of eight views each subpixel of a small part of the kiosk shows."""
    rig = numbers_of(KIOSK_4K)
    pitch = rig["pitch_subpx"] * (1 + rig["gap_mm"] / rig["distance_mm"])
    columns, rows, wide, high, left, top, views = 30, 8, 22, 40, 60, 58, 8
    picture = Drawing()

    def lens_coordinate(column, row):
        """Near the middle of the panel, for the design eye."""
        return (column - columns / 2 + 3 * rig["slant"] * (row - rows / 2)) / pitch

    for j in range(rows):
        for i in range(columns):
            phase = lens_coordinate(i + 0.5, j + 0.5)
            place = phase - math.floor(phase + 0.5)
            view = min(views - 1, math.floor(views * (0.5 - place)))
            x, y = left + i * wide, top + j * high
            picture.box(x, y, wide - 1, high - 1, f"hsl({20 + 30 * view},65%,78%)")
            picture.box(x, y + high - 7, wide - 1, 6, ("#d33", "#2a2", "#33d")[i % 3])
            picture.text(x + wide / 2 - 0.5, y + 21, str(view), "middle plain")
    for k in range(-3, 3):
        # The border between the lenses k and k + 1, at the top and at the bottom.
        ends = [left + (columns / 2 + (k + 0.5) * pitch - 3 * rig["slant"] * (j - rows / 2)) * wide
                for j in (0, rows)]
        if left <= ends[1] and ends[0] <= left + columns * wide:
            picture.line((ends[0], top), (ends[1], top + rows * high), colour="#000", width=2)
            if k in (0, 1):
                begin, end = ends[0] - pitch * wide + 4, ends[0] - 4
                picture.line((begin, 46), (begin, 34), (end, 34), (end, 46))
                picture.text((begin + end) / 2, 24, f"lens {k}", "middle")
    for row in (0, rows - 1):
        picture.text(left - 8, top + row * high + 25, f"row {row}", "end")
    return picture.finish(left + columns * wide + 20, top + rows * high + 16)


def optics_lobes(_):
    """View number along the viewing line: lobes repeat."""
    rig, views = numbers_of(KIOSK_4K), 8
    lobe = rig["pitch_subpx"] * rig["pixel_width_mm"] / 3 * rig["distance_mm"] / rig["gap_mm"]
    picture = Drawing()
    axes = Axes(picture, (70, 40, 740, 190), (-200, 200), (0, views))
    names = {-1: "lobe to the left", 0: f"main lobe, {lobe:.0f} mm wide", 1: "lobe to the right"}
    for k, name in names.items():
        begin, end = (k - 0.5) * lobe, (k + 0.5) * lobe
        picture.box(axes.x(begin), axes.top, axes.x(end) - axes.x(begin), axes.bottom - axes.top,
                    "#eef4fa" if k == 0 else "#f7f7f7")
        picture.line((axes.x(begin), axes.y(0)), (axes.x(end), axes.y(views)), colour=BLUE, width=1.6)
        picture.text((axes.x(begin) + axes.x(end)) / 2, axes.top - 12, name, "middle")
    for border in (-1.5, -0.5, 0.5, 1.5):
        x = axes.x(border * lobe)
        picture.line((x, axes.top), (x, axes.bottom), colour=GREY, dashed=True)
    for mm, name in ((-32, "left eye"), (32, "right eye")):
        view = views * (mm / lobe + 0.5)
        picture.dot(axes.x(mm), axes.y(view), 6, ORANGE)
        picture.text(axes.x(mm) + 12, axes.y(view) + 5, f"{name}: {view:.1f}")
    axes.finish(range(-200, 201, 50), range(0, views + 1, 2), "eye position x on the viewing line, mm",
                "view seen")
    return picture.finish(770, axes.bottom + 56)


def row_sweep(_):
    """One plane of rays, a triangle cut by it, and the lenses whose rays can meet the cut."""
    plane, left, pitch, far = 250, 70, 52, 30
    places, chosen = (-0.42, -0.14, 0.14, 0.42), 0.14
    cut = ((330, 120), (475, 70))
    picture = Drawing()
    picture.line((40, plane), (760, plane))
    for x in range(left, left + 13 * pitch, pitch):
        for tangent in places:
            end = (x + tangent * (plane - far), far)
            # As the sweep does it: the ray meets the cut if f changes its sign between the ends.
            f = [at[0] - (x + tangent * (plane - at[1])) for at in cut]
            if tangent != chosen:
                picture.line((x, plane), end, colour=PALE)
            elif f[0] * f[1] > 0:
                picture.line((x, plane), end, colour=GREY)
            else:
                s = f[0] / (f[0] - f[1])
                hit = tuple(a + s * (b - a) for a, b in zip(*cut))
                picture.line((x, plane), hit, colour=ORANGE, width=1.8)
                picture.dot(*hit, 4, ORANGE)
        picture.lens(x, plane, 24, 9)
    picture.line(*cut, colour=BLUE, width=4)
    picture.text(487, 74, "cut of a triangle with the plane")
    picture.text(487, 96, "orange: rays of one place that meet it")
    picture.text(44, plane + 34, "lens points of one pixel row, z = 0")
    return picture.finish(790, plane + 50)


def reuse(_):
    """A ray of the lens in the middle gets its colour from a chord between two points of a neighbour."""
    plane, traced, filled = 270, (150, 450), 300
    surface = [(x, 90 - 32 * math.sin(x / 220 - 0.18) ** 2 + (x - 300) ** 2 / 1000)
               for x in range(40, 640, 10)]

    def meets(x, tangent):
        for a, b in itertools.pairwise(surface):
            f, g = (at[0] - (x + tangent * (plane - at[1])) for at in (a, b))
            if f * g <= 0:
                s = f / (f - g)
                return a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])
        raise ValueError("the surface ends before the ray")

    picture = Drawing()
    picture.line(*surface)
    picture.text(470, 52, "surface")
    picture.line((40, plane), (600, plane))
    points = {(x, tangent): meets(x, tangent) for x in traced for tangent in (-0.45, -0.15, 0.15, 0.45)}
    for (x, _), point in points.items():
        picture.line((x, plane), point, colour=GREY)
    chord = (points[150, 0.15], points[150, 0.45])
    crossing = tuple((a + b) / 2 for a, b in zip(*chord))
    picture.line((filled, plane), crossing, colour=ORANGE, width=1.8)
    picture.line(*chord, colour=BLUE, width=4)
    for point in points.values():
        picture.dot(*point, 3.5, "#444")
    picture.dot(*crossing, 5, ORANGE)
    picture.text(crossing[0] - 12, crossing[1] - 12, "chord", "end")
    for x in (*traced, filled):
        picture.lens(x, plane, 60, 13)
        picture.text(x, plane + 32, "lens to fill" if x == filled else "traced lens", "middle")
    return picture.finish(640, plane + 46)
