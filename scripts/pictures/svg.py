# SPDX-License-Identifier: Apache-2.0
"""SVG pictures: lines, lenses, words, and the axes of plots."""

import math

ORANGE, BLUE, GREY, PALE = "#d55e00", "#0072b2", "#999", "#e6e6e6"
STYLE = """text { font: 14px sans-serif; fill: #222; paint-order: stroke; stroke: #fff; stroke-width: 4px }
.plain { stroke: none }
.middle { text-anchor: middle }
.end { text-anchor: end }
polyline { fill: none }
"""


class Drawing:
    """An SVG picture, drawn from the back to the front."""

    def __init__(self):
        self.parts = []

    def line(self, *points, colour="#444", width=1.2, dashed=False):
        coordinates = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashes = ' stroke-dasharray="4 3"' if dashed else ""
        self.parts.append(f'<polyline points="{coordinates}" stroke="{colour}" '
                          f'stroke-width="{width}"{dashes}/>')

    def box(self, x, y, width, height, fill, edge="none", edge_width=1):
        self.parts.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" '
                          f'fill="{fill}" stroke="{edge}" stroke-width="{edge_width}"/>')

    def dot(self, x, y, radius, fill, edge="none"):
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{fill}" '
                          f'stroke="{edge}" stroke-width="2"/>')

    def text(self, x, y, words, kind=""):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}">{words}</text>')

    def upright_text(self, x, y, words):
        self.parts.append(f'<text transform="translate({x},{y}) rotate(-90)" class="middle">{words}</text>')

    def lens(self, x, top, half_width, depth):
        """The front of a lens whose apex is at (x, top)."""
        self.parts.append(f'<path d="M{x - half_width:.1f},{top + depth} Q{x:.1f},{top - depth} '
                          f'{x + half_width:.1f},{top + depth}" fill="#dcebf7" stroke="#7aa3c7"/>')

    def arrow(self, begin, end):
        self.line(begin, end)
        length = math.dist(begin, end)
        along = [(e - b) / length for b, e in zip(begin, end)]
        for side in (-1, 1):
            self.line(end, (end[0] - 8 * along[0] - 4 * side * along[1],
                            end[1] - 8 * along[1] + 4 * side * along[0]))

    def span(self, begin, end):
        """A measured distance, horizontal or vertical, with a bar at each end."""
        across = (5, 0) if begin[0] == end[0] else (0, 5)
        self.line(begin, end)
        for x, y in (begin, end):
            self.line((x - across[0], y - across[1]), (x + across[0], y + across[1]))

    def finish(self, width, height):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
                f'width="{width}" height="{height}">\n<style>\n{STYLE}</style>\n'
                f'<rect width="{width}" height="{height}" rx="6" fill="#fff"/>\n'
                + "\n".join(self.parts) + "\n</svg>\n")


class Axes:
    """The axes of a plot: numbers to places in a drawing."""

    def __init__(self, picture, frame, x_range, y_range):
        self.picture = picture
        self.left, self.top, self.right, self.bottom = frame
        self.x_range, self.y_range = x_range, y_range

    def x(self, value):
        low, high = self.x_range
        return self.left + (value - low) / (high - low) * (self.right - self.left)

    def y(self, value):
        low, high = self.y_range
        return self.bottom - (value - low) / (high - low) * (self.bottom - self.top)

    def finish(self, x_values, y_values, x_title, y_title):
        for value in x_values:
            self.picture.line((self.x(value), self.bottom), (self.x(value), self.bottom + 4))
            self.picture.text(self.x(value), self.bottom + 20, f"{value:g}", "middle")
        for value in y_values:
            self.picture.line((self.left - 4, self.y(value)), (self.left, self.y(value)))
            self.picture.text(self.left - 8, self.y(value) + 5, f"{value:g}", "end")
        self.picture.text((self.left + self.right) / 2, self.bottom + 42, x_title, "middle")
        self.picture.upright_text(24, (self.top + self.bottom) / 2, y_title)
        self.picture.line((self.left, self.top), (self.left, self.bottom), (self.right, self.bottom))
