# SPDX-License-Identifier: Apache-2.0
"""Tests the calibration's camera code on vivid: an HDMI input in a loop, and a webcam."""

from test_vivid import VIVID, node_called
from vm_test import require_program, vm_test

SENT = [(1, 1, 1), (1, 1, 0), (0, 1, 1), (0, 1, 0), (1, 0, 1), (1, 0, 0), (0, 0, 1),
        (0.5, 0.5, 0.5)]
BT709_WEIGHTS = (0.2126, 0.7152, 0.0722)
WEBCAM, INPUT, OUTPUT = "vivid-001-vid-cap", "vivid-000-vid-cap", "vivid-000-vid-out"


def probe(vm):
    return require_program(vm, "vm_camera_probe")


def set_control(vm, node, name, value):
    vm.check([probe(vm), "set", node, name, str(value)])


def watch(vm, node, pixel_format="YUYV", size=(320, 180), rate=30, count=30, **options):
    return vm.start([probe(vm), "watch", node, pixel_format, *map(str, size), str(rate),
                     str(count)], **options)


def watched(vm, *arguments, **options):
    result = watch(vm, *arguments, **options).wait(120)
    assert result.code == 0, result
    return Report(result.stdout)


class Report:
    """The output of a watching probe, by the first word of each line."""

    def __init__(self, text):
        self.text = text
        self._lines = [line.partition(" ") for line in text.splitlines()]

    def all(self, word):
        return [rest for first, _, rest in self._lines if first == word]

    def one(self, word):
        [line] = self.all(word)
        return line

    def patches(self):
        return [tuple(map(float, line.split())) for line in self.all("patch")]


def linear_bt709(encoded):
    return encoded / 4.5 if encoded < 0.081 else ((encoded + 0.099) / 1.099) ** (1 / 0.45)


def linear_srgb(encoded):
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


def expected_light(colour, channels, curve, weights=BT709_WEIGHTS):
    if channels == 3:
        return tuple(map(curve, colour))
    return (curve(sum(weight * part for weight, part in zip(weights, colour))),)


def assert_near(seen, expected, allowed, about):
    assert len(seen) == len(expected), (about, seen, expected)
    worst = max(abs(a - b) for a, b in zip(seen, expected))
    assert worst <= allowed, f"{about}: {seen} instead of {expected}"


@vm_test(VIVID)
def cameras_are_listed_and_outputs_are_not(vm):
    listed = vm.check([probe(vm), "list"]).stdout
    cameras = [line.split()[0] for line in listed.splitlines() if line.startswith("/dev/")]
    assert set(cameras) == {node_called(vm, INPUT), node_called(vm, WEBCAM)}, listed
    assert "  YUYV\n" in listed and "  GREY\n" in listed, listed


@vm_test(VIVID)
def received_colours_match_sent_ones(vm):
    camera, output = node_called(vm, INPUT), node_called(vm, OUTPUT)
    vm.check([probe(vm), "loop", camera, "1"])
    set_control(vm, camera, "OSD Text Mode", 2)
    for pixel_format in ("RGB3", "YUYV"):
        sender = vm.start([probe(vm), "send", output, pixel_format])
        sender.wait_for_line("sending", 60)
        report = watched(vm, camera, pixel_format, (1280, 720), 60, 30)
        sender.kill()
        assert report.one("facts").startswith(f"{pixel_format} 1280x720"), report.text
        assert report.one("ready") == "30, corrupt 0, timed out 0", report.text
        assert report.one("disorders") == "0", report.text
        for colour, seen in zip(SENT, report.patches(), strict=True):
            assert_near(seen, expected_light(colour, len(seen), linear_bt709), 0.02, pixel_format)
    vm.check([probe(vm), "loop", camera, "0"])


def assert_bars(vm, camera, pixel_format):
    """Checks the colours of the driver's bars of 100 %, for any transfer function."""
    report = watched(vm, camera, pixel_format, count=1, rate=60)
    for colour, seen in zip([*SENT[:7], (0, 0, 0)], report.patches(), strict=True):
        expected = expected_light(colour, len(seen), linear_srgb)
        # The driver's own Y'CbCr is up to one code too low.
        assert_near(seen, expected, 0.035, f"{pixel_format} {colour}")


@vm_test(VIVID)
def the_drivers_own_colours_are_seen_in_every_format(vm):
    camera = node_called(vm, WEBCAM)
    listed = vm.check([probe(vm), "list"]).stdout
    offered = listed.partition(f"{camera} ")[2].partition("/dev/")[0].split()
    wanted = ("GREY", "Y16", "Y12", "Y10", "RGGB", "GRBG", "BA81", "GBRG", "YUYV", "UYVY", "NV12",
              "RGB3", "BGR3")
    formats = [name for name in wanted if name in offered]
    assert len(formats) >= 10, listed
    set_control(vm, camera, "OSD Text Mode", 2)
    set_control(vm, camera, "Test Pattern", 1)  # bars of 100 %
    for pixel_format in formats:
        assert_bars(vm, camera, pixel_format)
    set_control(vm, camera, "Test Pattern", 0)


@vm_test(VIVID)
def the_drivers_colour_description_is_used(vm):
    camera = node_called(vm, WEBCAM)
    set_control(vm, camera, "OSD Text Mode", 2)
    set_control(vm, camera, "Test Pattern", 1)
    full, limited, bt709, smpte240m = 1, 2, 2, 8
    for pixel_format, encoding, quantization in (
            ("YUYV", bt709, full), ("NV12", smpte240m, limited), ("UYVY", 0, full),
            ("RGB3", 0, limited)):
        set_control(vm, camera, "Y'CbCr Encoding", encoding)
        set_control(vm, camera, "Quantization", quantization)
        assert_bars(vm, camera, pixel_format)
    for name in ("Y'CbCr Encoding", "Quantization", "Test Pattern"):
        set_control(vm, camera, name, 0)


@vm_test(VIVID)
def damaged_and_lost_pictures_are_counted_and_skipped(vm):
    camera = node_called(vm, WEBCAM)
    watching = watch(vm, camera, rate=60, count=150)
    watching.wait_for_line("streaming", 60)
    for _ in range(3):
        set_control(vm, camera, "Inject V4L2_BUF_FLAG_ERROR", 1)
    report = Report(watching.wait(120).stdout)
    # Buttons pressed during one frame damage one picture.
    good = ["149, corrupt 1, ", "148, corrupt 2, ", "147, corrupt 3, "]
    assert report.one("ready").removesuffix("timed out 0") in good, report.text
    set_control(vm, camera, "Percentage of Dropped Buffers", 40)
    report = watched(vm, camera, rate=60, count=60)
    assert report.one("ready") == "60, corrupt 0, timed out 0", report.text
    assert report.one("disorders") == "0", report.text
    assert int(report.one("span")) > 70, f"no gap shows: {report.text}"
    set_control(vm, camera, "Percentage of Dropped Buffers", 0)


@vm_test(VIVID)
def restarted_counters_continue_counting(vm):
    camera = node_called(vm, WEBCAM)
    set_control(vm, camera, "Wrap Sequence Number", 1)
    report = watched(vm, camera, rate=60, count=150)
    assert report.one("ready") == "150, corrupt 0, timed out 0", report.text
    assert report.one("disorders") == "0", report.text
    assert 149 <= int(report.one("span")) < 5000, report.text
    set_control(vm, camera, "Wrap Sequence Number", 0)


def is_lost_and_opens_again(vm, button, said):
    camera = node_called(vm, WEBCAM)
    watching = watch(vm, camera, count=100000)
    watching.wait_for_line("streaming", 60)
    set_control(vm, camera, button, 1)
    result = watching.wait(60)
    assert result.code == 0, result
    report = Report(result.stdout)
    assert report.one("gone") == f"{camera}: {said}", report.text
    assert report.one("ready") == "5, corrupt 0, timed out 0", report.text


@vm_test(VIVID)
def a_fatal_error_ends_the_stream_and_the_camera_opens_again(vm):
    is_lost_and_opens_again(vm, "Inject Fatal Streaming Error",
                            "the stream broke: input/output error")


@vm_test(VIVID)
def an_unplugged_camera_is_lost_and_opens_again(vm):
    # vivid connects itself again only after the last user has closed it.
    is_lost_and_opens_again(vm, "Disconnect", "unplugged")


@vm_test(VIVID)
def a_failed_start_leaves_nothing_behind(vm):
    camera = node_called(vm, WEBCAM)
    for button in ("Inject VIDIOC_REQBUFS Error", "Inject VIDIOC_STREAMON Error"):
        set_control(vm, camera, button, 1)
        result = watch(vm, camera).wait(60)
        assert result.code == 3 and camera in result.stderr, result
        assert watched(vm, camera, count=2).one("ready") == "2, corrupt 0, timed out 0"


@vm_test(VIVID)
def a_camera_in_use_names_its_user(vm):
    camera = node_called(vm, WEBCAM)
    watching = watch(vm, camera, count=100000)
    watching.wait_for_line("streaming", 60)
    result = watch(vm, camera, "GREY").wait(60)
    assert result.code == 3, result
    assert "in use by another program" in result.stderr, result
    assert f"vm_camera_probe ({watching.pid})" in result.stderr, result
    watching.kill()


@vm_test(VIVID)
def a_forbidden_camera_names_the_group(vm):
    camera = node_called(vm, WEBCAM)
    vm.check(f"chgrp video {camera} && chmod 660 {camera}")
    result = watch(vm, camera, uid=1000).wait(60)
    assert result.code == 3, result
    assert "permission denied" in result.stderr and "usermod -aG video" in result.stderr, result
    member = watch(vm, camera, count=2, uid=1000, groups=("video",)).wait(60)
    assert member.code == 0, member


@vm_test(VIVID)
def controls_are_kept_and_drift_is_detected(vm):
    camera = node_called(vm, WEBCAM)
    set_control(vm, camera, "Gain, Automatic", 1)
    watching = watch(vm, camera, rate=60, count=200)
    watching.wait_for_line("streaming", 60)
    set_control(vm, camera, "Brightness", 77)
    set_control(vm, camera, "Gain, Automatic", 1)
    report = Report(watching.wait(120).stdout)
    assert "Brightness was 128 and is now 77" in report.all("drift"), report.text
    assert "Gain, Automatic was 0 and is now 1" in report.all("drift"), report.text
    unlocked = ["no manual exposure", "no manual white balance", "no manual focus"]
    assert report.all("unlocked") == unlocked, report.text
    set_control(vm, camera, "Brightness", 128)
