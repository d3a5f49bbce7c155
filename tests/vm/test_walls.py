# SPDX-License-Identifier: Apache-2.0
"""Tests a wall of two panels on one card: one player, one commit, on the kernel's own code."""

import signal
import subprocess

import picture
from content import PIXEL_MM, RIG
from playing import STATS, stats, wait_until, wait_until_shown
from vm_test import Machine, require_program, vm_test

SIZE = (1024, 768)  # both outputs list this mode
TWO = Machine(display="virtio-gpu", width=SIZE[0], height=SIZE[1], outputs=2)
PANELS = ("left", "right")
FRAMES = 3

WALL = """format = 1
viewer_mm = [0.0, 0.0, 700.0]
[[panel]]
name = "left"
rig = "rig.toml"
output = "Virtual-1"
centre_mm = [-90.0, 0.0, 0.0]
[[panel]]
name = "right"
rig = "rig.toml"
output = "Virtual-2"
centre_mm = [90.0, 0.0, 0.0]
"""


def connect_both(vm):
    """Connects both outputs, of which QEMU has connected the first."""
    for number in (1, 2):
        vm.write_file(f"/sys/class/drm/card0-Virtual-{number}/status", "on")


def make_wall(vm):
    """Renders pictures for both panels where the guest sees them; returns the folder."""
    folder = vm.exchange / "wall"
    if not folder.exists():
        folder.mkdir()
        (folder / "wall.toml").write_text(WALL)
        (folder / "rig.toml").write_text(
            RIG.format(width=SIZE[0], height=SIZE[1], pixel=PIXEL_MM, identity=""))
        subprocess.run([require_program(vm, "lenticule"), "render", "builtin:demo:2", "--wall",
                        folder / "wall.toml", "--frames", f"0:{FRAMES}", "-o", folder / "%05d.png"],
                       check=True, capture_output=True, timeout=300)
    return folder


def play_wall(vm, *flags):
    vm.run(["rm", "-f", STATS])
    return vm.start([require_program(vm, "lenticule"), "play", "/exchange/wall/%05d.png", "--wall",
                     "/exchange/wall/wall.toml", "--display", "kms", "--stats", STATS, *flags])


@vm_test(TWO)
def each_panel_shows_its_own_picture(vm):
    connect_both(vm)
    folder = make_wall(vm)
    player = play_wall(vm, "--frames", "1:2", "--loop", "forever")
    wait_until_shown(vm, player)
    for head, panel in enumerate(PANELS):
        vm.wait_for_screen(picture.read(folder / f"00001-{panel}.png"), head=head)
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr


@vm_test(TWO)
def all_panels_change_in_one_commit(vm):
    connect_both(vm)
    make_wall(vm)
    player = play_wall(vm, "--fps", "3", "--loop", "6")
    result = player.wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == 6 * FRAMES, done
    kms = done["kms"]
    assert kms["flips"] == 6 * FRAMES and kms["one_commit"], kms
    assert kms["flip_timeouts"] == 0 and kms["stray_events"] == 0, kms
    print(f"largest difference of two panels: {kms['largest_skew_us']:.0f} us")


@vm_test(TWO)
def a_missing_panel_is_waited_for(vm):
    connect_both(vm)
    folder = make_wall(vm)
    vm.write_file("/sys/class/drm/card0-Virtual-2/status", "off")
    result = play_wall(vm, "--duration", "2").wait(60)
    assert result.code == 3, result
    assert "panel 'right': kms: no panel is connected" in result.stderr, result.stderr
    player = play_wall(vm, "--frames", "1:2", "--loop", "forever", "--wait-for-panel", "60")
    wait_until(lambda: "panel 'right'" in player.stderr, player)
    vm.write_file("/sys/class/drm/card0-Virtual-2/status", "on")
    wait_until_shown(vm, player)
    vm.wait_for_screen(picture.read(folder / "00001-right.png"), head=1)
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr
