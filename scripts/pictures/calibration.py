# SPDX-License-Identifier: Apache-2.0
"""Pictures of the pages about calibration and test cards.

Each function takes a Studio and returns a picture.
"""

import re

import numpy

from pictures.raster import crop, read, smaller
from pictures.studio import KIOSK_1080, ROOT


def side_by_side(pictures):
    """Returns the pictures in sixteen levels of each channel, which noisy ones compress well with."""
    space = numpy.full((len(pictures[0]), 12, 3), 255, numpy.uint8)
    row = numpy.hstack([part for picture in pictures for part in (space, picture)][1:])
    return ((row.astype(int) + 8) // 17 * 17).astype(numpy.uint8)


def rig_with(studio, key, value):
    """Writes the sample rig with another value; returns the file."""
    text, count = re.subn(rf"(?m)^{key} = .*", f"{key} = {value}", KIOSK_1080.read_text())
    assert count == 1, key
    file = studio.folder / f"{key}.toml"
    file.write_text(text)
    return file


def recorded(studio, name, *command, keys=None):
    """Returns the last file that a command records of a virtual display."""
    folder = studio.folder / name
    folder.mkdir()
    studio.run(*command, "--display", "virtual", "--record", f"png:{folder}", keys=keys)
    return max(folder.glob("*.png"))


def by_eye_questions(studio):
    """Two questions of `lenticule calibrate by-eye`, as an eye sees them through the true sheet."""
    def question(enters, key, start):
        chart = recorded(studio, f"charts-{enters}", "calibrate", "by-eye", "--rig", rig_with(studio, key, start), "-o",
                         studio.folder / "unused.toml", keys=f"enter*{enters} q")
        return smaller(studio.eye(chart, rig_with(studio, "name", '"sheet"'), 0, 1920, 1080, 1)[:654], 4)

    return side_by_side([question(1, "pitch_subpx", 7.98), question(5, "slant", 0.238)])


def calibration_patterns(studio):
    """Four of the pictures that a simulated camera takes of the patterns."""
    seen = studio.folder / "seen"
    studio.run("bench", "calibrate", "--plain", "--panel-width", 1280, "--camera-width", 640, "--viewpoints", 1,
               "--noise", 0.003, "--pictures", seen, "-o", studio.folder / "rig.toml")
    files = sorted(seen.glob("centre-*.png"))
    return side_by_side([smaller(crop(read(files[n]), 108, 56, 428, 248), 2) for n in (20, 36, 68, 92)])


def test_card(studio):
    """The test card of `lenticule play card`."""
    return read(recorded(studio, "card", "play", "card", "--rig", KIOSK_1080.relative_to(ROOT), "--clock", "simulated",
                         "--loop", 1))
