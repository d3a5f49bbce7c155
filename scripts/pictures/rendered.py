# SPDX-License-Identifier: Apache-2.0
"""Pictures of rendered scenes.

Each function takes a Studio and returns a picture, or a list of pictures for an animation.
"""

import os
import subprocess
import time

import numpy

from pictures.raster import (brightest, crop, larger, outline, read, read_xwd, sheet, smaller, write)
from pictures.studio import KIOSK_1080, KIOSK_4K, enlarged_part


def guide(picture, x):
    """Draws a dotted vertical line, which shows how far objects move between two pictures."""
    for y in range(3):
        picture[y::6, x] = 255


def first_look(studio):
    """README: two eyes, the woven frame, and its subpixels."""
    woven = studio.demo()
    frame = read(woven)
    left, right = (studio.eye(woven, KIOSK_4K, x, 480, 270) for x in (-32, 32))
    for picture in (left, right):
        for x in (24, 405):
            guide(picture, x)
    x0, y0, scale = 752, 1730, 15
    detail = enlarged_part(frame, x0, y0, 32, 18, scale)
    whole = smaller(frame, 8)
    outline(whole, x0 // 8 - 3, y0 // 8 - 3, 10, 9)
    return sheet([[("left eye, 32 mm left of the middle", left), ("right eye, 32 mm right of it", right)],
                  [("woven frame, 3840 x 2160 pixels", whole),
                   ("32 x 18 pixels of it, and the lenses", detail)]])


def eye_moves(studio):
    """README: what one eye sees while it moves sideways through the viewing zone."""
    woven = studio.demo()
    return [studio.eye(woven, KIOSK_4K, -48 + 6 * k, 480, 270) for k in range(17)]


def methods(studio):
    """Error maps of the render methods against full."""
    def third(method, *flags):
        folder = studio.folder / f"methods-{method}{''.join(flags)}".replace(" ", "")
        folder.mkdir(exist_ok=True)
        studio.run("render", "builtin:primitives", "--rig", KIOSK_1080, "--method", method, *flags,
                   "--frames", "1:4", "-o", folder / "%05d.ppm")
        return folder / "00003.ppm"

    full = third("full")

    def part(picture):
        return crop(picture, 420, 216, 1120, 800)

    def error_map(method, *flags):
        return brightest(part(studio.difference(full, third(method, *flags))), 3)

    eye = studio.eye(full, KIOSK_1080, 0, 640, 360, 3)
    scene = crop(eye, 140, 72, 373, 266)
    return sheet([[("full, seen by one eye", scene), ("lens-view", error_map("lens-view")),
                   ("interpolate", error_map("interpolate"))],
                  [("temporal, camera moving", error_map("temporal")),
                   ("adaptive, E = 2", error_map("adaptive", "--error", "2")),
                   ("adaptive, E = 8", error_map("adaptive", "--error", "8"))]], gap=8)


def adaptive_worst(studio):
    """The worst place of method adaptive, as `lenticule bench error --pictures` finds it."""
    folder = studio.folder / "worst"
    studio.run("bench", "error", "primitives", "--rig", KIOSK_1080, "--course", "still", "--methods",
               "full,adaptive", "--errors", "8", "--no-peers", "--pictures", folder)
    source = next(folder.glob("*-1.png"))
    ppm = studio.folder / "worst.ppm"
    studio.run("convert", source, "-o", ppm)
    found = read(ppm)
    # The command enlarges four times; three times are enough here.
    tiles = [[larger(crop(found, x, y, 384, 384)[::4, ::4], 3) for x in (0, 392, 784)] for y in (0, 392)]
    return sheet([list(zip(("full", "adaptive, E = 8", "difference"), tiles[0])),
                  list(zip(("full, by one eye", "adaptive, by one eye", "difference"), tiles[1]))])


def shading(studio):
    """A row of balls, one for each term of the shading formula."""
    lines = ["v", "from 0 -14 3.2", "at 0 0 0.9", "up 0 0 1", "angle 22", "hither 1", "resolution 512 288",
             "b 0.25 0.35 0.5", "l -6 -12 14", "l 8 -10 9"]
    materials = ["0.9 0.35 0.2 0.9 0 1 0 1", "0.9 0.35 0.2 0.8 0.12 60 0 1",
                 "0.95 0.95 0.95 0.15 0.8 200 0 1", "0.95 1 0.97 0.05 0.1 200 0.9 1.5"]
    for k, material in enumerate(materials):
        lines += [f"f {material}", f"s {2.2 * (k - 1.5)} 0 1 1"]
    for i in range(-8, 8):
        for j in range(-4, 8):
            lines.append("f {0} {0} {0} 1 0 1 0 1".format(0.8 if (i + j) % 2 else 0.3))
            corners = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
            lines += ["p 4"] + [f"{1.2 * x} {1.2 * y} 0" for x, y in corners]
    scene = studio.folder / "balls.nff"
    scene.write_text("\n".join(lines) + "\n")
    woven = studio.frame(str(scene), KIOSK_4K)
    return crop(studio.eye(woven, KIOSK_4K, 0, 800, 450), 0, 130, 800, 200)


def soft_light(studio):
    """Hard light and the three kinds of soft light."""
    def seen(*flags):
        grey = ("--ground", "--ground-colour", "0.7,0.7,0.7")
        woven = studio.frame("builtin:teapot", KIOSK_1080, *grey, *flags)
        return crop(studio.eye(woven, KIOSK_1080, 0, 720, 405, 2), 120, 110, 480, 270)

    return sheet([[("hard light", seen()),
                   ("soft shadows 16, light size 60", seen("--soft-shadows", "16", "--light-size", "60"))],
                  [("occlusion 16", seen("--occlusion", "16", "--occlusion-distance", "200")),
                   ("sky, environment light 32", seen("--sky", "--environment-light", "32"))]])


def depth_budget(studio):
    """A deep scene's depth, and part of it with one ray per subpixel and averaged over the beam."""
    flags = ("--depth-budget", "4")
    depth = studio.folder / "depth.ppm"
    studio.run("depth", "builtin:tree", "--rig", KIOSK_1080, *flags, "--picture", depth)
    depth = smaller(read(depth), 4)

    def seen(*more):
        woven = studio.frame("builtin:tree", KIOSK_1080, *flags, *more)
        return larger(crop(studio.eye(woven, KIOSK_1080, 0, 960, 540, 2), 610, 208, 120, 90), 3)

    x, y = 610 // 2, 208 // 2
    outline(depth, x, y, 60, 45)
    return sheet([[("depth of each subpixel", crop(depth, 60, 0, 420, 270)), ("one ray", seen()),
                   ("prefilter beam", seen("--prefilter", "beam"))]])


def content(studio):
    """A quilt, the frame woven from it, and the pictures of two eyes."""
    woven = studio.demo()
    # Tile 0 is the bottom-left one and belongs to the leftmost camera.
    views = [studio.eye(woven, KIOSK_4K, 125 * (k - 3.5) / 8, 480, 270) for k in range(8)]
    quilt = numpy.vstack([numpy.hstack(views[4:]), numpy.hstack(views[:4])])
    path = studio.folder / "demo_qs4x2a1.7778.png"
    write(quilt, path)
    again = studio.folder / "content.ppm"
    studio.run("weave", path, "--rig", KIOSK_4K, "-o", again)
    x0, y0, scale = 752, 1730, 12
    detail = enlarged_part(read(again), x0, y0, 26, 15, scale)
    eyes = [studio.eye(again, KIOSK_4K, x, 320, 180) for x in (-32, 32)]
    title = "quilt, 4 x 2 views from left to right, the first at the bottom left"
    return sheet([[(title, smaller(quilt, 2))],
                  [("woven frame, enlarged", detail), ("left eye", eyes[0]), ("right eye", eyes[1])]])


def overlays(studio):
    """A film with four overlays, as an eye sees it."""
    y, x = numpy.indices((300, 300)) - 149.5
    radius = numpy.hypot(x, y)
    logo = numpy.zeros((300, 300, 4), numpy.uint8)
    logo[..., :3] = numpy.where((numpy.abs(x + y) < 40)[..., None], (255, 255, 255), (240, 120, 20))
    logo[..., 3] = (255 * numpy.clip(145 - radius, 0, 1)).round()
    write(logo, studio.folder / "logo.png")
    film = studio.folder / "overlays.toml"
    film.write_text(f"""
[[item]]
source = "{studio.demo()}"
duration_s = 0.25
overlay = [
  {{picture = "logo.png", at = "top right", height = 0.14}},
  {{clock = "15:28", at = "top left", height = 0.09}},  # the same in each picture
  {{text = "Open until 8", at = "bottom left", height = 0.09}},
  {{code = "https://example.org/more", height = 0.35}},
]
""")
    folder = studio.folder / "overlaid"
    folder.mkdir()
    studio.run("play", film, "--rig", KIOSK_4K, "--clock", "simulated", "--display", "virtual",
               "--record", f"png:{folder}")
    return studio.eye(max(folder.glob("*.png")), KIOSK_4K, 0, 640, 360, 3)


def window(studio):
    """display: the desktop window of `play --display window`, on an X server in memory."""
    woven = studio.demo()
    with open(studio.folder / "number", "w+", encoding="ascii") as number:
        server = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "1280x360x24",
                                   "-fbdir", studio.folder], stdout=number)
        try:
            while not number.read():
                number.seek(0)
                time.sleep(0.1)
            number.seek(0)
            player = subprocess.Popen(
                [studio.program, "play", woven, "--rig", KIOSK_4K, "--display", "window"],
                env=os.environ | {"DISPLAY": ":" + number.read().strip(), "SDL_VIDEODRIVER": "x11"})
            while not (picture := read_xwd(studio.folder / "Xvfb_screen0")).any():
                time.sleep(0.1)
            time.sleep(2)  # for a picture that was being drawn
            picture = read_xwd(studio.folder / "Xvfb_screen0")
            player.terminate()
            player.wait()
        finally:
            server.terminate()
            server.wait()
    return picture


def scenes(studio):
    """The built-in scenes."""
    def tile(scene):
        flags = ("--frames", "6") if scene != "balls" else ()
        woven = studio.frame(f"builtin:{scene}", KIOSK_1080, *flags)
        return scene, studio.eye(woven, KIOSK_1080, 0, 236, 132, 4)

    names = ("demo teapot room small-balls", "primitives tree gears balls")
    return sheet([[tile(scene) for scene in row.split()] for row in names])
