# SPDX-License-Identifier: Apache-2.0
"""Tests lenticule play v4l2:DEVICE with the kernel's vivid: webcams and an HDMI input."""

import json
import signal

import picture
from content import PIXEL_MM, RIG
from playing import SOCKET, STATS, ctl, stats, wait_until, wait_until_shown
from test_camera import INPUT, WEBCAM, set_control
from test_vivid import VIVID, node_called
from vm_test import Machine, require_program, vm_test

BARS = [(255, 255, 255), (255, 255, 0), (0, 255, 255), (0, 255, 0), (255, 0, 255), (255, 0, 0),
        (0, 0, 255)]
SIZE = (320, 180)
PAIR = Machine(modules=("vivid n_devs=2 node_types=0x1,0x1 num_inputs=1,1 input_types=0,0",))


def start(vm, source, *flags, size=SIZE, refresh=60):
    """Starts a player of that source on a virtual display of that size."""
    rig = vm.exchange / f"rig-{size[0]}x{size[1]}.toml"
    rig.write_text(RIG.format(width=size[0], height=size[1], pixel=PIXEL_MM, identity=""))
    vm.run(["rm", "-f", STATS])
    return vm.start([require_program(vm, "lenticule"), "play", source, "--rig",
                     f"/exchange/{rig.name}", "--display",
                     f"virtual:{size[0]}x{size[1]}@{refresh}", "--stats", STATS, *flags])


def end(player):
    player.send(signal.SIGTERM)
    result = player.wait(60)
    assert result.code == 143, result
    return result


def show_bars(vm, camera):
    set_control(vm, camera, "OSD Text Mode", 2)
    set_control(vm, camera, "Test Pattern", 1)  # bars of 100 %


@vm_test(VIVID)
def the_drivers_colours_reach_the_panel(vm):
    camera = node_called(vm, WEBCAM)
    show_bars(vm, camera)
    for pixel_format in ("RGB3", "BGR3", "YUYV", "UYVY", "NV12"):
        folder = vm.exchange / f"shown-{pixel_format}"
        folder.mkdir()
        source = f"v4l2:{camera}?size=320x180&format={pixel_format}&rate=30"
        player = start(vm, source, "--record", f"png:/exchange/{folder.name}", "--duration", "2")
        assert player.wait(120).code == 0, player.stderr
        done = stats(vm)
        assert f"320x180 {pixel_format}" in done["live"]["device"], done["live"]
        assert done["live"]["pictures"] >= 5 and done["live"]["damaged"] == 0, done["live"]
        assert done["capture_to_submit_us"]["count"] >= done["shown"], done
        shown = picture.read(sorted(folder.glob("*.png"))[-1])
        for k, colour in enumerate(BARS):
            seen = shown.pixel((2 * k + 1) * SIZE[0] // 16, SIZE[1] // 2)
            worst = max(abs(a - b) for a, b in zip(seen, colour, strict=True))
            assert worst <= 3, (pixel_format, k, seen, colour)
    set_control(vm, camera, "Test Pattern", 0)


@vm_test(VIVID)
def views_in_a_camera_picture_are_woven(vm):
    camera = node_called(vm, WEBCAM)
    player = start(vm, f"v4l2:{camera}?size=640x360&rate=30", "--stereo", "sbs", size=(48, 32))
    now = wait_until_shown(vm, player, 20)
    assert now["live"]["weaving_us"]["count"] >= 20, now["live"]
    end(player)


@vm_test(VIVID)
def an_unplugged_camera_comes_back(vm):
    camera = node_called(vm, WEBCAM)
    player = start(vm, f"v4l2:{camera}?size=320x180", "--control", SOCKET)
    wait_until_shown(vm, player, 10)
    set_control(vm, camera, "Disconnect", 1)
    wait_until(lambda: "unplugged" in ctl(vm, "status")["last_problem"], player)
    wait_until(lambda: stats(vm)["playlist"]["items_started"] >= 2, player)
    before = stats(vm)["live"]["pictures"]
    wait_until(lambda: stats(vm)["live"]["pictures"] > before + 10, player)
    end(player)


@vm_test(VIVID)
def a_lost_signal_is_named_and_its_return_noticed(vm):
    camera = node_called(vm, INPUT)
    current, lost, selected = 0, 1, 4
    set_control(vm, camera, "DV Timings", 0)  # 640x480: a larger picture takes an emulated processor long
    set_control(vm, camera, "DV Timings Signal Mode", selected)
    player = start(vm, f"v4l2:{camera}", "--grid", "1x1", "--control", SOCKET, size=(48, 32))
    wait_until_shown(vm, player, 3)
    assert ": 640x480 " in stats(vm)["live"]["device"], stats(vm)["live"]
    set_control(vm, camera, "DV Timings Signal Mode", lost)
    wait_until(lambda: "signal" in ctl(vm, "status")["last_problem"], player)
    started = stats(vm)["playlist"]["items_started"]
    set_control(vm, camera, "DV Timings", 2)  # 720x480, progressive
    set_control(vm, camera, "DV Timings Signal Mode", selected)
    wait_until(lambda: stats(vm)["playlist"]["items_started"] > started
               and ": 720x480" in stats(vm)["live"]["device"], player)
    set_control(vm, camera, "DV Timings Signal Mode", current)
    end(player)


@vm_test(VIVID)
def the_device_says_what_it_offers_and_what_is_wrong(vm):
    camera = node_called(vm, WEBCAM)
    result = start(vm, f"v4l2:{camera}?size=320x180", "--preflight", "--json").wait(60)
    assert result.code == 0, result
    [row] = json.loads(result.stdout)
    formats = {offer["format"] for offer in row["live"]["offers"]}
    assert {"YUYV", "NV12", "RGB3"} <= formats, row
    for source, words in ((f"v4l2:{camera}?size=321x181", "has no pictures of 321x181"),
                          ("v4l2:/dev/video77", "no such file"),
                          ("v4l2:/dev/null", "not a video device")):
        result = start(vm, source).wait(60)
        assert result.code == 3 and words in result.stderr, result


@vm_test(PAIR)
def two_cameras_are_left_and_right(vm):
    left, right = node_called(vm, "vivid-000-vid-cap"), node_called(vm, "vivid-001-vid-cap")
    player = start(vm, f"v4l2:{left},{right}?size=320x180&rate=30", size=(48, 32))
    now = wait_until_shown(vm, player, 30)
    live = now["live"]
    assert live["pictures"] >= 30, live
    assert live["apart_us"]["max"] <= 17_000, "partners are at most half a period apart"
    assert left in live["device"] and right in live["device"], live
    end(player)
