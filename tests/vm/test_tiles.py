# SPDX-License-Identifier: Apache-2.0
"""Tests a panel with two connectors: one commit shows both halves, on the kernel's own code."""

import json
import shutil
import signal
import subprocess

import picture
import tiled_edid
from content import Content
from playing import play, stats, wait_until_shown
from vm_test import Machine, Skip, require_program, vm_test

TILE = (1024, 768)  # both outputs list this mode
TWO = Machine(display="virtio-gpu", width=TILE[0], height=TILE[1], outputs=2,
              kernel=tiled_edid.SECOND_OUTPUT)


def connect_tiles(vm):
    """Connects both outputs as the tiles of one panel, side by side."""
    tiled_edid.set_edids(vm, [tiled_edid.tile_edid(2, 1, column, 0, *TILE) for column in range(2)])


def half(whole, column):
    """Returns the part of a frame that a tile shows."""
    width, height = TILE
    rows = [whole.rgb[(y * whole.width + column * width) * 3:][:width * 3] for y in range(height)]
    return picture.Picture(width, height, b"".join(rows))


@vm_test(TWO)
def edid_decode_reads_the_tiles(vm):
    decoder = shutil.which("edid-decode")
    if decoder is None:
        raise Skip("edid-decode is not installed")
    for column in range(2):
        edid = tiled_edid.tile_edid(2, 1, column, 0, *TILE)
        found = subprocess.run([decoder, "--check", "-"], input=edid, capture_output=True,
                               timeout=20)
        text = found.stdout.decode()
        assert "Tiled Display Topology" in text, text
        assert f"Tile location: {column}, 0" in text, text
        assert "Num horizontal tiles: 2 Num vertical tiles: 1" in text, text
        assert f"Tile resolution: {TILE[0]}x{TILE[1]}" in text, text
        assert "invalid" not in text.lower(), text


@vm_test(TWO)
def both_tiles_show_their_half_of_each_frame(vm):
    connect_tiles(vm)
    content = Content(vm, 2 * TILE[0], TILE[1], 2)
    player = play(vm, content, "--frames", "1:2", "--loop", "forever")
    wait_until_shown(vm, player)
    for column in range(2):
        vm.wait_for_screen(half(content.frame(1), column), head=column)
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr


@vm_test(TWO)
def both_tiles_change_in_one_commit(vm):
    connect_tiles(vm)
    content = Content(vm, 2 * TILE[0], TILE[1], 2)
    player = play(vm, content, "--fps", "3", "--loop", "6")
    result = player.wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == 12, done
    kms = done["kms"]
    assert kms["flips"] == 12 and kms["flip_timeouts"] == 0 and kms["stray_events"] == 0, kms
    print(f"largest skew of two tiles: {kms['largest_skew_us']:.0f} us")


@vm_test(TWO)
def a_panel_without_one_of_its_cables_is_refused(vm):
    connect_tiles(vm)
    vm.write_file("/sys/class/drm/card0-Virtual-2/status", "off")
    content = Content(vm, 2 * TILE[0], TILE[1], 2)
    result = play(vm, content, "--duration", "2").wait(60)
    assert result.code == 3, result
    assert "the panel has 2 connectors, and 1 of them can be used" in result.stderr, result.stderr


@vm_test(TWO)
def doctor_lists_both_tiles_and_tests_them_as_one(vm):
    connect_tiles(vm)
    doctor = [require_program(vm, "lenticule"), "doctor", "--json"]
    result = vm.run(doctor, 60)
    assert result.code == 0, result
    found = json.loads(result.stdout)
    [panel] = found["tiled_panels"]
    size = (panel["width_px"], panel["height_px"])
    assert panel["complete"] and size == (2 * TILE[0], TILE[1]), panel
    assert [tile["connector"] for tile in panel["tiles"]] == ["Virtual-1", "Virtual-2"], panel
    [output] = found["outputs"]
    assert output["connectors"] == ["Virtual-1", "Virtual-2"] and output["tested"], output
    vm.write_file("/sys/class/drm/card0-Virtual-2/status", "off")
    found = json.loads(vm.run(doctor, 60).stdout)
    [panel] = found["tiled_panels"]
    assert not panel["complete"] and panel["tiles"][1]["connector"] is None, panel
    [output] = found["outputs"]
    assert "1 of them can be used" in output["problem"], output
