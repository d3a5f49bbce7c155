# SPDX-License-Identifier: Apache-2.0
"""Frames and pictures that lenticule makes, and parts of woven frames, enlarged."""

import functools
import pathlib
import re
import subprocess
import sys

import numpy

from pictures.raster import crop, read, smaller, subpixels

ROOT = pathlib.Path(__file__).resolve().parents[2]
KIOSK_4K = ROOT / "scenes/rigs/kiosk-27-4k.toml"
KIOSK_1080 = ROOT / "scenes/rigs/kiosk-27-1080.toml"


def numbers_of(rig):
    """Returns the numbers of a rig file."""
    found = re.findall(r"^(\w+) = ([\d.]+)$", rig.read_text(), re.MULTILINE)
    return {name: float(value) for name, value in found}


class Studio:
    """Runs lenticule in a folder of its own and keeps the frames that several pictures share."""

    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        (folder / "scenes").symlink_to(ROOT / "scenes")  # for pictures that name a rig's file

    def run(self, *arguments, keys=None):
        command = [str(self.program), *(str(a) for a in arguments)]
        done = subprocess.run(command, cwd=self.folder, input=keys, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")
        return done.stdout

    @functools.lru_cache(maxsize=None)
    def frame(self, scene, rig, *flags):
        """Renders one frame and returns its file."""
        name = self.folder / (re.sub(r"\W+", "-", "-".join((scene, rig.stem, *flags))) + ".ppm")
        self.run("render", scene, "--rig", rig, *flags, "-o", name)
        return name

    def eye(self, woven, rig, x, width, height, supersample=2):
        """The picture that an eye at (x, 0, 700) mm sees of a woven frame."""
        out = self.folder / "eye.ppm"
        self.run("eye", woven, "--rig", rig, "--eye", f"{x},0,700",
                 "--size", f"{width * supersample}x{height * supersample}", "-o", out)
        return smaller(read(out), supersample)

    def difference(self, reference, test):
        """The error map of `lenticule compare --picture`."""
        out = self.folder / "difference.ppm"
        self.run("compare", reference, test, "--picture", out)
        return read(out)

    def demo(self):
        """The demo scene, deep enough that two eyes differ visibly."""
        return self.frame("builtin:demo", KIOSK_4K, "--depth-budget", "5", "--frames", "6")


def lens_borders(picture, scale, x0, y0, rig):
    """Draws the borders between lenses, as the design eye sees them, over an enlarged part at (x0, y0)."""
    pitch = rig["pitch_subpx"] * (1 + rig["gap_mm"] / rig["distance_mm"])
    y, x = numpy.indices(picture.shape[:2]) + 0.5
    along = x0 + x / scale - rig["width_px"] / 2 + rig["slant"] * (y0 + y / scale - rig["height_px"] / 2)
    lens = numpy.floor(3 * along / pitch + 0.5)
    picture[:, :-1][lens[:, :-1] != lens[:, 1:]] = 255


def enlarged_part(frame, x0, y0, width, height, scale):
    """Part of a woven frame of the 4K kiosk: subpixels, a little brighter, and borders of lenses."""
    detail = subpixels(crop(frame, x0, y0, width, height), scale)
    detail = (255 * (detail / 255) ** 0.7).round().astype(numpy.uint8)
    lens_borders(detail, scale, x0, y0, numbers_of(KIOSK_4K))
    return detail
