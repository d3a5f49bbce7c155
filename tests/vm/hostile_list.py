# SPDX-License-Identifier: Apache-2.0
"""A playlist of good items between files that are broken, huge, lying, vanishing or replaced.

The regular files are made on the host, in a folder of the guest's /exchange, and copied in the guest
to HOME; devices, pipes, links and files without permission are made there. Every good item has
pictures of its own, so that a picture on the display belongs to one frame of one item.
"""

import collections
import dataclasses
import itertools
import os
import shutil
import subprocess

import hostile_files as files
import picture
from content import PIXEL_MM, RIG
from vm_test import require_program

WIDTH, HEIGHT = 320, 480
HOME = "/tmp/hostile"
FRAMES, RATE = 4, 2  # of a film, and per second: every frame is seen several times on a busy host, too
LEFT_OUT, DAMAGED, KEPT = "left out", "damaged", "the previous one continues"


@dataclasses.dataclass
class Item:
    kind: str  # of the item, for the table
    source: str
    pictures: list  # the frames that must be shown; empty for an item that cannot be played
    reports: tuple = ()  # each is printed exactly once
    settings: dict = dataclasses.field(default_factory=dict)
    also: list = dataclasses.field(default_factory=list)  # pictures that may be shown as well
    trick: str = ""  # command of the guest, run while the item plays
    undo: str = ""  # command of the guest, run when the item is over

    def toml(self):
        lines = ["[[item]]", f"source = {_quoted(self.source)}"]
        for key, value in self.settings.items():
            lines.append(f"{key} = {_quoted(value) if isinstance(value, str) else value}")
        return "\n".join(lines) + "\n"

    def printed(self):
        """Returns the source as the player prints it: on one line, without control characters."""
        return "".join(f"\\x{ord(letter):02x}" if letter < " " else letter for letter in self.source)


def _quoted(text):
    escaped = {"\\": "\\\\", '"': '\\"', "\x1b": "\\u001b", "\n": "\\n"}
    return '"' + "".join(escaped.get(letter, letter) for letter in text) + '"'


class HostileList:
    """Makes the files on the host. Call install() once to make the guest's copy.

    per_kind: the largest number of items of each kind.
    """

    def __init__(self, vm, per_kind=1000):
        self._vm = vm
        self._program = require_program(vm, "lenticule")
        self.folder = vm.exchange / "hostile"
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()
        self._scratch = vm.exchange / "hostile-scratch"
        self._script = []  # commands of the guest that make what the host cannot share
        self._seeds = itertools.count(1)
        self.items = []
        self.rig = self._write_rig("rig.toml")
        self._other_rig = self._write_rig("other-rig.toml", pitch="7.701", other="8.25")
        self._make()
        self.items = some_of_each_kind(self.items, per_kind)

    # -- for the test ------------------------------------------------------------------------------

    def install(self, rounds):
        self._write("list.toml", f"format = 1\nloop = {rounds}\n".encode()
                    + "".join(item.toml() for item in self.items).encode())
        self._vm.check(["rm", "-rf", HOME])
        self._vm.check(["cp", "-r", f"/exchange/{self.folder.name}", HOME])
        self._write("make.sh", "".join(f"{line} || exit 1\n" for line in self._script).encode())
        self._vm.check(f"cd {HOME} && sh /exchange/{self.folder.name}/make.sh")
        return f"{HOME}/list.toml"

    def good(self):
        return [item for item in self.items if item.pictures]

    def counts(self):
        """Returns the number of items per kind."""
        return collections.Counter(item.kind for item in self.items)

    # -- files -------------------------------------------------------------------------------------

    def _write(self, name, data):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        return path

    def _write_rig(self, name, pitch="", other=""):
        text = RIG.format(width=WIDTH, height=HEIGHT, pixel=PIXEL_MM, identity="")
        self._write(name, text.replace(pitch, other).encode())
        return self.folder / name

    def _picture(self):
        return files.blocks(WIDTH, HEIGHT, next(self._seeds))

    def _lenticule(self, *arguments):
        done = subprocess.run([self._program, *map(str, arguments)], capture_output=True, text=True,
                              timeout=300)
        assert done.returncode == 0, (arguments, done.stderr)

    def _film(self, name, *flags, rig=None, frames=FRAMES):
        """Writes a film of numbered pictures by the program under test; returns its frames."""
        shown = [self._picture() for _ in range(frames)]
        shutil.rmtree(self._scratch, ignore_errors=True)
        self._scratch.mkdir()
        for number, frame in enumerate(shown):
            (self._scratch / f"{number:05d}.png").write_bytes(files.png(frame))
        self._lenticule("convert", self._scratch / "%05d.png", "--rig", rig or self.rig, "--rate",
                        RATE, "-o", self.folder / name, *flags)
        return shown

    def _woven(self, source):
        """Returns the frame that is woven from views, in the program's own conversion to a file."""
        shutil.rmtree(self._scratch, ignore_errors=True)
        self._scratch.mkdir()
        self._lenticule("convert", source, "--rig", self.rig, "-o", self._scratch / "woven.png")
        return picture.read(self._scratch / "woven.png")

    # -- items -------------------------------------------------------------------------------------

    def _still(self, name, shown, kind="good picture", **more):
        self.items.append(Item(kind, f"{HOME}/{name}", [shown],
                               settings={"duration_s": 1.5, "wait_s": 100}, **more))

    def _moving(self, name, shown, kind="good film", **more):
        settings = {"wait_s": 100, **more.pop("settings", {})}
        self.items.append(Item(kind, f"{HOME}/{name}", shown, settings=settings, **more))

    def _bad(self, kind, name, data=None):
        """Adds an item that cannot be played; with data, writes its file."""
        if data is not None:
            self._write(name, data)
        source = name if ":" in name.split("/")[0] else f"{HOME}/{name}"
        self.items.append(Item(kind, source, [], reports=(LEFT_OUT,), settings={"wait_s": 100}))

    def _make(self):
        """Adds all items. Good ones are between the bad ones of each kind."""
        self._first_item()
        self._good_pictures()
        bad = len(self.items)
        self._broken_pictures()
        self._huge_pictures()
        self._no_files()
        self._broken_sequences()
        self._broken_videos()
        self._broken_views()
        self._mix(bad)
        self._tricks()

    def _mix(self, first):
        """Deals the good items out among the bad ones."""
        bad = [item for item in self.items[first:] if not item.pictures]
        good = self.items[1:first] + [item for item in self.items[first:] if item.pictures]
        mixed, share = self.items[:1], len(bad) / len(good)
        for number, item in enumerate(good):
            mixed += [item, *bad[round(number * share):round((number + 1) * share)]]
        self.items = mixed

    def _first_item(self):
        """The item during which the test begins to record."""
        shown = self._picture()
        self._write("first.png", files.png(shown))
        self._still("first.png", shown)
        self.items[-1].settings["duration_s"] = 6

    def _good_pictures(self):
        writers = {"png": files.png, "ppm": picture.Picture.ppm, "bmp": files.bmp, "tga": files.tga,
                   "tif": files.tiff, "exr": files.exr}
        for extension, write in writers.items():
            shown = self._picture()
            self._write(f"good.{extension}", write(shown))
            self._still(f"good.{extension}", shown)
        self._write("good.jpg", files.jpeg(WIDTH, HEIGHT, WIDTH * HEIGHT // 64))
        self._still("good.jpg", files.grey(WIDTH, HEIGHT, 128))
        for name in ["\x1b[31mred\x1b[2J.png", "two words \u00fc.png", "-rf.png"]:
            shown = self._picture()
            self._write(name, files.png(shown))
            self._still(name, shown, kind="good picture with an odd name")
        self._script.append("mv good.tif linked-to && ln -s linked-to good.tif")
        frames = [self._picture() for _ in range(FRAMES)]
        for number, frame in enumerate(frames):
            self._write(f"pattern/{number:05d}.png", files.png(frame))
        self._moving("pattern/%05d.png", frames, settings={"fps": str(RATE)})
        self._moving("good.lts", self._film("good.lts"))
        frames = self._film("index.lts")
        self._change("index.lts", lambda data: data[:-60] + bytes(60))
        self._moving("index.lts", frames, kind="good film without its index")
        self._moving("good.mkv", self._film("good.mkv"), kind="good video")
        self._good_views()

    def _good_views(self):
        quilt = files.blocks(5 * 80, 3 * 60, next(self._seeds))
        self._write("good_qs5x3a0.7.png", files.png(quilt))
        # Seven columns leave one pixel of the width, which belongs to no view.
        self._write("remainder_qs7x7a0.7.png", files.png(files.blocks(400, 180, next(self._seeds))))
        for number in range(3):
            self._write(f"view{number:02d}.png",
                        files.png(files.blocks(120, 160, next(self._seeds))))
        self._write("eyes_sbs.png", files.png(files.blocks(320, 240, next(self._seeds))))
        for name in ["good_qs5x3a0.7.png", "remainder_qs7x7a0.7.png", "eyes_sbs.png"]:
            self._still(name, self._woven(self.folder / name), kind="good views, woven while playing")
        self.items.append(Item("good views, woven while playing", f"views:{HOME}/view%02d.png",
                               [self._woven(f"views:{self.folder}/view%02d.png")],
                               settings={"duration_s": 1.5, "wait_s": 100}))

    def _change(self, name, change):
        path = self.folder / name
        path.write_bytes(change(path.read_bytes()))

    def _broken_pictures(self):
        kind = "broken picture"
        shown = self._picture()
        whole = files.png(shown)
        self._bad(kind, "empty.png", b"")
        self._bad(kind, "noise.png", picture.noise(40, 40, seed=1).rgb)
        self._bad(kind, "noise-after-signature.png", whole[:8] + picture.noise(40, 40, seed=2).rgb)
        self._bad(kind, "cut.png", whole[:len(whole) // 2])
        self._bad(kind, "flipped.png", whole[:5000] + bytes([whole[5000] ^ 255]) + whole[5001:])
        self._bad(kind, "words.ppm", b"these are words, not a picture\n")
        self._bad(kind, "cut.ppm", shown.ppm()[:-1000])
        self._bad(kind, "letters.ppm", b"P6\nwide high\n255\n" + shown.rgb)
        self._bad(kind, "cut.jpg", files.jpeg(WIDTH, HEIGHT, 1000, end=b""))
        self._bad(kind, "cut-with-end.jpg", files.jpeg(WIDTH, HEIGHT, 1000))
        self._bad(kind, "noise.jpg", b"\xff\xd8\xff" + picture.noise(40, 40, seed=3).rgb)
        self._bad(kind, "cut.tif", files.tiff(shown)[:-200])
        self._bad(kind, "cut.bmp", files.bmp(shown)[:-70000])
        self._bad(kind, "cut.tga", files.tga(shown)[:-70000])
        lines = files.exr(shown)
        self._bad(kind, "cut.exr", lines[:len(lines) // 2])
        self._bad(kind, "noise.exr", lines[:8] + picture.noise(40, 40, seed=4).rgb)
        self._bad(kind, "broken.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 480 +X 320\n\2\2")
        frames = [files.png(self._picture()) for _ in range(3)]
        for number, frame in enumerate(frames):
            self._write(f"cut-first/{number:05d}.png", frame[:len(frame) // (3 - number)])
        self._bad(kind, "cut-first/%05d.png")

    def _huge_pictures(self):
        kind = "huge or lying picture"
        shown = self._picture()
        data = files.zlib.compress(b"".join(b"\0" + row for row in files.rows_of(shown)[:100]))
        self._bad(kind, "bomb.png", files.png_bomb(16000, 16000))
        self._bad(kind, "lying.png", files.png_of(WIDTH, HEIGHT, data))
        self._bad(kind, "largest.png", files.png_of(0x7FFFFFFF, 0x7FFFFFFF, data))
        self._bad(kind, "nothing.png", files.png_of(0, 0, data))
        self._bad(kind, "bomb_qs8x6a0.7.png", files.png_bomb(16000, 16000))
        self._bad(kind, "other-size.png", files.png(files.blocks(100, 100, next(self._seeds))))
        self._bad(kind, "lying.jpg", files.jpeg(WIDTH, HEIGHT, 1))
        self._bad(kind, "largest.jpg", files.jpeg(65500, 65500, 1000))
        self._bad(kind, "largest.ppm", files.ppm_of(100000, 100000, shown.rgb))
        self._bad(kind, "largest.exr", files.exr_of(2000000000, 2000000000, []))
        self._bad(kind, "largest.bmp", files.bmp_of(0x7FFFFFFF, 0x7FFFFFFF, shown.rgb))
        self._bad(kind, "largest.tga", files.tga_of(65535, 65535, shown.rgb))
        self._bad(kind, "largest.tif", files.tiff_of(0x7FFFFFFF, 0x7FFFFFFF, shown.rgb[:3000]))
        self._bad(kind, "lying.tif", files.tiff_of(WIDTH, HEIGHT, shown.rgb[:3000], 0x7FFFFFFF))

    def _no_files(self):
        kind = "not a file that can be read"
        for name, command in {
                "pipe.png": "mkfifo", "pipe.lts": "mkfifo", "pipe.mkv": "mkfifo",
                "zeros.png": "ln -s /dev/zero", "dangling.png": "ln -s nowhere",
                "circle.png": "ln -s circle.png", "process.png": "ln -s /proc/self/mem"}.items():
            self._script.append(f"{command} {name}")
            self._bad(kind, name)
        self._script.append("mknod device.png c 1 5")
        self._bad(kind, "device.png")
        socket = "import socket; socket.socket(socket.AF_UNIX).bind('socket.png')"
        self._script.append(f'/usr/bin/python3 -c "{socket}"')
        self._bad(kind, "socket.png")
        self._bad(kind, "forbidden.png", files.png(self._picture()))
        self._script.append("chmod 000 forbidden.png")
        self._bad(kind, "closed/picture.png", files.png(self._picture()))
        self._script.append("chmod 700 closed")
        kind = "missing file"
        for name in ["missing.png", "missing.lts", "missing.mkv", "missing/%05d.png", "a" * 300 + ".png",
                     "good.png/below.png", "\x1b[2J\x1b[1;1Hmissing.png", "line\nend.png"]:
            self._bad(kind, name)
        kind = "not a kind that is played"
        self._bad(kind, "list.txt", b"good.png\n")
        self._bad(kind, "script.sh", b"#!/bin/sh\nexit 1\n")
        self._bad("a ring without a renderer", "ring:/tmp/no-renderer.sock")
        self.items[-1].settings["wait_s"] = 2

    def _broken_sequences(self):
        kind = "broken film"
        whole = (self.folder / "good.lts").read_bytes()
        first = whole.index(b"LTSF")
        self._bad(kind, "empty.lts", b"")
        self._bad(kind, "noise.lts", picture.noise(40, 40, seed=5).rgb)
        self._bad(kind, "no-frames.lts", whole[:first])
        self._bad(kind, "cut-in-metadata.lts", whole[:first - 10])
        self._bad(kind, "header.lts", whole[:20] + b"\xff" + whole[21:])
        self._bad(kind, "no-good-frame.lts",
                  whole[:first + 60] + bytes(len(whole) - first - 60 - 100) + whole[-100:])
        self._film("other-rig.lts", rig=self._other_rig)
        self._bad(kind, "other-rig.lts")
        kind = "damaged film"
        shown = self._film("cut.lts")
        data = (self.folder / "cut.lts").read_bytes()
        starts = [at for at in range(len(data)) if data.startswith(b"LTSF", at)]
        assert len(starts) == FRAMES, starts
        self._write("cut.lts", data[:starts[3] + 100])
        self._moving("cut.lts", shown[:3], kind, reports=(DAMAGED,))
        shown = self._film("damaged.lts")
        data = bytearray((self.folder / "damaged.lts").read_bytes())
        starts = [at for at in range(len(data)) if data.startswith(b"LTSF", at)]
        data[starts[3] - 50] ^= 1  # in frame 2, which frame 1 replaces
        self._write("damaged.lts", bytes(data))
        self._moving("damaged.lts", shown[:2] + shown[3:], kind, reports=(DAMAGED,))

    def _broken_videos(self):
        kind = "broken video"
        whole = (self.folder / "good.mkv").read_bytes()
        self._bad(kind, "empty.mkv", b"")
        self._bad(kind, "noise.mkv", picture.noise(40, 40, seed=6).rgb)
        self._bad(kind, "words.mp4", b"these are words, not pictures\n")
        self._bad(kind, "cut-in-header.mkv", whole[:300])
        self._bad(kind, "largest.y4m", b"YUV4MPEG2 W100000 H100000 F25:1 Ip C444\nFRAME\n")
        self._bad(kind, "other-size.y4m", b"YUV4MPEG2 W100 H100 F25:1 Ip C444\nFRAME\n"
                  + bytes(30000))
        self._bad(kind, "half-chroma.y4m", f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F25:1 Ip C420jpeg\nFRAME\n".encode()
                  + bytes(WIDTH * HEIGHT * 3 // 2))
        kind = "damaged video"
        shown = self._film("cut.mkv")
        data = (self.folder / "cut.mkv").read_bytes()
        self._write("cut.mkv", data[:len(data) * 3 // 5])
        self._moving("cut.mkv", shown[:2], kind, reports=(DAMAGED,), also=shown[2:3])
        shown = self._film("damaged.mkv")
        data = bytearray((self.folder / "damaged.mkv").read_bytes())
        data[len(data) * 5 // 8] ^= 255  # in frame 2
        self._write("damaged.mkv", bytes(data))
        self._moving("damaged.mkv", shown[:2] + shown[3:], kind, reports=(DAMAGED,))

    def _broken_views(self):
        kind = "broken views"
        quilt = files.png(files.blocks(400, 180, next(self._seeds)))
        self._bad(kind, "no-tiles_qs0x0a0.7.png", quilt)
        self._bad(kind, "many_qs1000x1000a0.7.png", quilt)
        self._bad(kind, "cut_qs5x3a0.7.png", quilt[:len(quilt) // 2])
        self._bad(kind, f"views:{HOME}/gone%02d.png")
        self._bad(kind, f"views:{HOME}/good.png|{HOME}/other-size.png")
        self._bad(kind, f"views:{HOME}/good.png|{HOME}/cut.png")
        self._bad(kind, "depth_rgbd.png", quilt)
        self._write("depth_rgbd.json", b"{ this is not JSON")

    def _tricks(self):
        """Adds items whose files change while they play. They come last, so that all files of the
        first round are there when it begins. They play for 25 s: in an item's last 10 s the player
        no longer looks for a new version, because it opens the next item."""
        kind = "vanishing or replaced file"
        shown, other = self._picture(), self._picture()
        self._write("replaced.png", files.png(shown))
        self._write("replacement", files.png(other))
        self._write("original", files.png(shown))
        self._trick("replaced.png", [shown, other], "cp replacement new && mv new replaced.png",
                    "cp original new && mv new replaced.png", reports=())
        shown = self._picture()
        self._write("spoilt.png", files.png(shown))
        self._write("spoilt-original", files.png(shown))
        self._trick("spoilt.png", [shown], "head -c 700 spoilt-original > new && mv new spoilt.png",
                    "cp spoilt-original new && mv new spoilt.png")
        shown = self._picture()
        self._write("vanishing.png", files.png(shown))
        self._trick("vanishing.png", [shown], "mv vanishing.png vanished",
                    "mv vanished vanishing.png")
        shown = self._film("vanishing.lts")
        self._trick("vanishing.lts", shown, "mv vanishing.lts vanished.lts",
                    "mv vanished.lts vanishing.lts")
        self._write("gone-in-time.png", files.png(self._picture()))
        self._bad(kind, "gone-in-time.png")
        self.items[0].trick = f"rm -f {HOME}/gone-in-time.png"
        shown = self._picture()
        self._write("last.png", files.png(shown))
        self._still("last.png", shown)

    def _trick(self, name, shown, trick, undo, reports=(KEPT,)):
        self.items.append(Item("vanishing or replaced file", f"{HOME}/{name}", shown, reports,
                               settings={"duration_s": 25, "wait_s": 100}, trick=f"cd {HOME} && {trick}",
                               undo=f"cd {HOME} && {undo}"))


def some_of_each_kind(items, count):
    """Returns at most that many items of each kind: the first, the last, and evenly between them."""
    chosen = set()
    for kind in {item.kind for item in items}:
        places = [at for at, item in enumerate(items) if item.kind == kind]
        steps = max(1, min(count, len(places)) - 1)
        chosen |= {places[step * (len(places) - 1) // steps] for step in range(min(count, len(places)))}
    return [item for at, item in enumerate(items) if at in chosen]
