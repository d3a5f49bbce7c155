# SPDX-License-Identifier: Apache-2.0
"""The rigs of which the pictures are, and the numbers of their files."""

import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
KIOSK_4K = ROOT / "scenes/rigs/kiosk-27-4k.toml"
KIOSK_1080 = ROOT / "scenes/rigs/kiosk-27-1080.toml"


def numbers_of(rig):
    """The numbers of a rig file that the drawings need."""
    names = {"distance_mm", "gap_mm", "height_px", "pitch_subpx", "pixel_width_mm", "slant", "width_px"}
    found = re.findall(r"^(\w+) = ([\d.]+)$", rig.read_text(), re.MULTILINE)
    return {name: float(value) for name, value in found if name in names}
