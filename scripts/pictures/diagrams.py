# SPDX-License-Identifier: Apache-2.0
"""Diagrams of the optics and of the render methods, and a plot of docs/measurements/error.md.

Each function takes a Studio, which it does not need, and returns an SVG picture.
"""

import io
import itertools
import math

import matplotlib
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path

from pictures.studio import KIOSK_4K, ROOT, numbers_of

ORANGE, BLUE, GREY, PALE = "#d55e00", "#0072b2", "#999999", "#e6e6e6"
# Text stays text, and every run writes the same bytes.
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "lenticule", "font.family": "sans-serif",
                            "font.size": 13, "lines.color": "#444444", "axes.spines.top": False,
                            "axes.spines.right": False})


class Drawing:
    """An SVG picture, drawn in pixels from the top left corner."""

    def __init__(self, width, height):
        self.figure = Figure((width / 72, height / 72))
        self.axes = self.figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(height, 0))
        self.axes.axis("off")

    def line(self, *points, colour="#444444", width=1.2, **style):
        self.axes.plot(*zip(*points), color=colour, linewidth=width, **style)

    def box(self, x, y, width, height, fill, edge="none", edge_width=1.0):
        self.axes.add_patch(Rectangle((x, y), width, height, facecolor=fill, edgecolor=edge, linewidth=edge_width,
                                      zorder=2))

    def dots(self, points, diameter, fill, edge="none"):
        self.axes.plot(*zip(*points), "o", markersize=diameter, color=fill, markeredgecolor=edge, markeredgewidth=2)

    def text(self, x, y, words, align="left"):
        self.axes.text(x, y, words, ha=align, color="#222222", zorder=3)

    def lens(self, x, top, half_width, depth):
        """Draws the front of a lens whose apex is at (x, top)."""
        corners = ((x - half_width, top + depth), (x, top - depth), (x + half_width, top + depth))
        self.axes.add_patch(PathPatch(Path(corners, (Path.MOVETO, Path.CURVE3, Path.CURVE3)), facecolor="#dcebf7",
                                      edgecolor="#7aa3c7", zorder=2))

    def arrow(self, begin, end, style="->"):
        self.axes.annotate("", end, begin, arrowprops={"arrowstyle": style, "color": "#444444", "shrinkA": 0,
                                                       "shrinkB": 0})


def svg(figure):
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def optics_ray(_):
    """From a subpixel through its lens to an eye: the panel from above."""
    pitch, glass, gap, distance, middle, lens_y = 110, 84, 56, 270, 380, 340
    pixel_y, eye_y = lens_y + glass, lens_y - distance
    lenses = [middle + pitch * k for k in range(-2, 3)]
    # The micro-images of the design eye in the middle: farther apart than the lenses.
    stripe = pitch * (1 + gap / distance) / 8
    first = middle - 20 * stripe
    picture = Drawing(770, pixel_y + 50)
    picture.box(40, lens_y, 680, glass, "#dcebf7")
    for n in range(40):
        picture.box(first + n * stripe, pixel_y, stripe, 18, ("#e8a09a", "#a8d5a2", "#a3b8e8")[n % 3], "white", 0.7)
    for x in lenses:
        picture.lens(x, lens_y, pitch / 2, 17)
    for y, words in ((eye_y, "viewing line, z = Z"), (lens_y, "panel plane, z = 0")):
        picture.line((40, y), (720, y), colour=GREY, linestyle="--")
        picture.text(44, y - 8, words)
    for side, name, colour in ((-1, "left eye", ORANGE), (1, "right eye E", BLUE)):
        eye = middle + 105 * side
        for x in lenses:
            behind = x - gap * (eye - x) / distance
            picture.line((eye, eye_y), (x, lens_y), (behind, pixel_y), colour=colour, width=1.6, zorder=3)
            subpixel = first + math.floor((behind - first) / stripe) * stripe
            picture.box(subpixel, pixel_y, stripe, 18, "none", colour, 2.5)
        picture.dots([(eye, eye_y)], 15, "white", colour)
        picture.text(eye + 6 * side, eye_y - 16, name, "center")
    picture.text(lenses[3] + 8, lens_y - 10, "lens point L")
    picture.text(44, pixel_y + 34, "pixels")
    picture.text(lenses[3], pixel_y + 34, "subpixel Q", "center")
    picture.arrow((738, lens_y), (738, pixel_y), "|-|")
    picture.text(750, lens_y + 46, "t")
    picture.arrow((middle - pitch / 2, lens_y - 30), (middle + pitch / 2, lens_y - 30), "|-|")
    picture.text(middle, lens_y - 40, "lens pitch", "center")
    for end, name in (((70, 200), "z"), ((120, 250), "x")):
        picture.arrow((70, 250), end)
        picture.text(end[0] + 6, end[1] + 5, name)
    return svg(picture.figure)


def optics_views(_):
    """Which of eight views each subpixel of a small part of the kiosk shows."""
    rig = numbers_of(KIOSK_4K)
    pitch = rig["pitch_subpx"] * (1 + rig["gap_mm"] / rig["distance_mm"])
    columns, rows, wide, high, left, top, views = 30, 8, 22, 40, 60, 58, 8
    picture = Drawing(left + columns * wide + 20, top + rows * high + 16)
    for j, i in itertools.product(range(rows), range(columns)):
        # The lens coordinate near the middle of the panel, for the design eye.
        phase = (i + 0.5 - columns / 2 + 3 * rig["slant"] * (j + 0.5 - rows / 2)) / pitch
        view = min(views - 1, math.floor(views * (0.5 - phase + math.floor(phase + 0.5))))
        x, y = left + i * wide, top + j * high
        picture.box(x, y, wide - 1, high - 1, matplotlib.colors.hsv_to_rgb((view / 12 + 0.05, 0.25, 0.93)))
        picture.box(x, y + high - 7, wide - 1, 6, ("#dd3333", "#22aa22", "#3333dd")[i % 3])
        picture.text(x + wide / 2 - 0.5, y + 21, str(view), "center")
    for k in range(-3, 3):
        # The border between the lenses k and k + 1, at the top and at the bottom.
        ends = [left + (columns / 2 + (k + 0.5) * pitch - 3 * rig["slant"] * (j - rows / 2)) * wide
                for j in (0, rows)]
        if left <= ends[1] and ends[0] <= left + columns * wide:
            picture.line((ends[0], top), (ends[1], top + rows * high), colour="black", width=2, zorder=3)
            if k in (0, 1):
                begin, end = ends[0] - pitch * wide + 4, ends[0] - 4
                picture.line((begin, 46), (begin, 34), (end, 34), (end, 46))
                picture.text((begin + end) / 2, 24, f"lens {k}", "center")
    for row in (0, rows - 1):
        picture.text(left - 8, top + row * high + 25, f"row {row}", "right")
    return svg(picture.figure)


def optics_lobes(_):
    """View number along the viewing line: lobes repeat."""
    rig, views = numbers_of(KIOSK_4K), 8
    lobe = rig["pitch_subpx"] * rig["pixel_width_mm"] / 3 * rig["distance_mm"] / rig["gap_mm"]
    figure = Figure((770 / 72, 246 / 72), layout="constrained")
    axes = figure.subplots(subplot_kw={
        "xlim": (-200, 200), "ylim": (0, views), "xlabel": "eye position x on the viewing line, mm",
        "ylabel": "view seen"})
    for k, name in enumerate(("lobe to the left", f"main lobe, {lobe:.0f} mm wide", "lobe to the right"), -1):
        begin, end = (k - 0.5) * lobe, (k + 0.5) * lobe
        axes.axvspan(begin, end, facecolor="#f7f7f7" if k else "#eef4fa", edgecolor=GREY, linestyle="--")
        axes.plot((begin, end), (0, views), color=BLUE)
        axes.text(k * lobe, views + 0.4, name, ha="center")
    for mm, name in ((-32, "left eye"), (32, "right eye")):
        view = views * (mm / lobe + 0.5)
        axes.plot(mm, view, "o", color=ORANGE, markersize=9)
        axes.annotate(f"{name}: {view:.1f}", (mm, view), (10, -5), textcoords="offset points")
    return svg(figure)


def row_sweep(_):
    """One plane of rays, a triangle cut by it, and the lenses whose rays can meet the cut."""
    plane, left, pitch, far = 250, 70, 52, 30
    places, chosen = (-0.42, -0.14, 0.14, 0.42), 0.14
    cut = ((330, 120), (475, 70))
    picture = Drawing(790, plane + 50)
    picture.line((40, plane), (760, plane))
    for x, tangent in itertools.product(range(left, left + 13 * pitch, pitch), places):
        hit = meeting(cut, x, plane, tangent)
        if tangent == chosen and hit:
            picture.line((x, plane), hit, colour=ORANGE, width=1.8)
            picture.dots([hit], 8, ORANGE)
        else:
            picture.line((x, plane), (x + tangent * (plane - far), far), colour=GREY if tangent == chosen else PALE)
        picture.lens(x, plane, 24, 9)
    picture.line(*cut, colour=BLUE, width=4)
    picture.text(487, 74, "cut of a triangle with the plane")
    picture.text(487, 96, "orange: rays of one place that meet it")
    picture.text(44, plane + 34, "lens points of one pixel row, z = 0")
    return svg(picture.figure)


def meeting(line, x, plane, tangent):
    """Returns where the ray from (x, plane) meets a line of points, or None.

    As the sweep does it: the ray meets a part of the line if f changes its sign between the ends.
    """
    for a, b in itertools.pairwise(line):
        f, g = (at[0] - (x + tangent * (plane - at[1])) for at in (a, b))
        if f * g <= 0:
            return tuple(p + f / (f - g) * (q - p) for p, q in zip(a, b))
    return None


def reuse(_):
    """A ray of the lens in the middle gets its colour from a chord between two points of a neighbour."""
    plane, traced, filled = 270, (150, 450), 300
    surface = [(x, 90 - 32 * math.sin(x / 220 - 0.18) ** 2 + (x - 300) ** 2 / 1000)
               for x in range(40, 640, 10)]
    picture = Drawing(640, plane + 46)
    picture.line(*surface)
    picture.text(470, 52, "surface")
    picture.line((40, plane), (600, plane))
    points = {(x, tangent): meeting(surface, x, plane, tangent)
              for x in traced for tangent in (-0.45, -0.15, 0.15, 0.45)}
    for (x, _), point in points.items():
        picture.line((x, plane), point, colour=GREY)
    chord = (points[150, 0.15], points[150, 0.45])
    crossing = tuple((a + b) / 2 for a, b in zip(*chord))
    picture.line((filled, plane), crossing, colour=ORANGE, width=1.8)
    picture.line(*chord, colour=BLUE, width=4)
    picture.dots(points.values(), 7, "#444444")
    picture.dots([crossing], 10, ORANGE)
    picture.text(crossing[0] - 12, crossing[1] - 12, "chord", "right")
    for x in (*traced, filled):
        picture.lens(x, plane, 60, 13)
        picture.text(x, plane + 32, "lens to fill" if x == filled else "traced lens", "center")
    return svg(picture.figure)


def time_error(_):
    """Time against error, from the first table of docs/measurements/error.md."""
    text = (ROOT / "docs/measurements/error.md").read_text()
    lines = [line for line in text.split("## All methods")[1].split("\n## ")[0].splitlines()
             if line.startswith("|") and "---" not in line]
    head, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    colours = {"lens-view": GREY, "interpolate": "#e69f00", "temporal": "#cc79a7",
               "adaptive 0.5": "#009e73", "adaptive 2": BLUE, "adaptive 8": "#56b4e9"}
    figure = Figure((740 / 72, 386 / 72), layout="constrained")
    axes = figure.subplots(subplot_kw={
        "xlim": (0, 2), "ylim": (25, 67), "yticks": range(30, 61, 10),
        "xlabel": "processor time relative to full", "ylabel": "mean PSNR, dB"})
    axes.grid(color=PALE)
    axes.axvline(1, color=GREY)
    equal = []
    for name, colour in colours.items():
        found = [row[head.index(name)].split(" %, ") for row in rows]
        places = [(1 - int(saved) / 100, psnr) for saved, psnr in found]
        axes.plot([x for x, psnr in places if psnr != "equal"], [float(psnr) for _, psnr in places if psnr != "equal"],
                  "o", color=colour, markersize=9, label=name)
        equal += [(x, colour) for x, psnr in places if psnr == "equal"]
    for x, colour in equal:
        axes.plot(x, 66, "o", markerfacecolor="none", markeredgecolor=colour, markersize=9)
    axes.plot([], [], "o", markerfacecolor="none", markeredgecolor="#444444", markersize=9, label="equal to full")
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
    return svg(figure)
