# SPDX-License-Identifier: Apache-2.0
"""Plots of measurements: of a table under docs/measurements, or made by `lenticule bench`.

Each function takes a Studio and returns an SVG picture.
"""

from pictures.rigs import ROOT
from pictures.svg import GREY, PALE, Axes, Drawing


def time_error(_):
    """Time against error, from the first table of docs/measurements/error.md."""
    text = (ROOT / "docs/measurements/error.md").read_text()
    lines = [line for line in text.split("## All methods")[1].split("\n## ")[0].splitlines()
             if line.startswith("|") and "---" not in line]
    head, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    colours = {"lens-view": "#999", "interpolate": "#e69f00", "temporal": "#cc79a7",
               "adaptive 0.5": "#009e73", "adaptive 2": "#0072b2", "adaptive 8": "#56b4e9"}
    picture = Drawing()
    axes = Axes(picture, (70, 20, 600, 330), (0, 2), (25, 67))
    times, decibels = (0, 0.5, 1, 1.5, 2), range(30, 61, 10)
    for time in times[1:]:
        x = axes.x(time)
        picture.line((x, axes.top), (x, axes.bottom), colour=GREY if time == 1 else PALE)
    for psnr in decibels:
        picture.line((axes.left, axes.y(psnr)), (axes.right, axes.y(psnr)), colour=PALE)
    for k, (name, colour) in enumerate(colours.items()):
        for row in rows:
            saved, psnr = row[head.index(name)].split(" %, ")
            x = axes.x(1 - int(saved) / 100)
            if psnr == "equal":
                picture.dot(x, axes.top + 6, 5, "none", colour)
            else:
                picture.dot(x, axes.y(float(psnr)), 5, colour)
        picture.dot(624, 34 + 24 * k, 5, colour)
        picture.text(636, 39 + 24 * k, name)
    picture.dot(624, 34 + 24 * len(colours), 5, "none", "#444")
    picture.text(636, 39 + 24 * len(colours), "equal to full")
    axes.finish(times, decibels, "processor time relative to full", "mean PSNR, dB")
    return picture.finish(740, axes.bottom + 56)


def hand_held(studio):
    """Errors of hand-held calibrations; takes some ten minutes."""
    plot = studio.folder / "hand-held.svg"
    studio.run("bench", "calibrate", "--hand", "--panel-width", "1920", "--camera-width", "3200",
               "--photographs", "1,2,3,4,6", "--draws", "10", "--first", "7201", "--plot", plot)
    return plot.read_text()
