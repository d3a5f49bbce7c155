# SPDX-License-Identifier: Apache-2.0
"""Woven frames to play in a guest, and the rig that they are woven for."""

import subprocess

import picture
from vm_test import require_program

PIXEL_MM = 0.15565  # of a 27 inch panel of 3840x2160; optics do not matter here

RIG = """format = 1
name = "panel of the virtual machine"

[panel]
width_px = {width}
height_px = {height}
pixel_width_mm = {pixel}
pixel_height_mm = {pixel}
layout = "rgb"

[sheet]
pitch_subpx = 7.701
slant = 0.2521
offset_lenses = 0.0
gap_mm = 4.476
refraction_shape = 0.4444444444444444
spot_sigma_lenses = 0.04

[viewing]
distance_mm = 700.0
height_mm = 0.0
{identity}"""


class Content:
    """Woven frames and their rig, made by the program under test, where host and guest see them."""

    def __init__(self, vm, width, height, count, identity=""):
        self.size = (width, height)
        self.count = count
        name = f"content-{width}x{height}-{count}"
        self.folder = vm.exchange / name
        self.guest = f"/exchange/{name}"
        self.rig = f"{self.guest}/rig.toml"
        self._render(require_program(vm, "lenticule"))
        self.set_identity(identity)

    def set_identity(self, identity):
        (self.folder / "rig.toml").write_text(
            RIG.format(width=self.size[0], height=self.size[1], pixel=PIXEL_MM,
                       identity=identity))

    def _render(self, program):
        if self.folder.exists():
            return
        self.folder.mkdir()
        self.set_identity("")
        subprocess.run([program, "render", "builtin:demo:2", "--rig", self.folder / "rig.toml",
                        "--frames", f"0:{self.count}", "-o", self.folder / "%05d.png"],
                       check=True, capture_output=True, timeout=300)

    def source(self):
        return f"{self.guest}/%05d.png"

    def frame(self, number):
        return picture.read(self.folder / f"{number:05d}.png")

    def frames(self):
        return [self.frame(number) for number in range(self.count)]
