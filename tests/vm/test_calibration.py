# SPDX-License-Identifier: Apache-2.0
"""Tests calibrating with a camera, from KMS to V4L2: only sheet and camera optics are simulated.

The patterns go through virtio-gpu; vm_calibration_camera reads what is scanned out, traces what a
camera sees of it through the lenses, and sends that through vivid's HDMI loop.
"""

import dataclasses
import json
import shlex
import time

from test_camera import INPUT, OUTPUT, set_control
from test_vivid import VIVID, node_called
from vm_test import require_program, vm_test

BENCH = dataclasses.replace(VIVID, display="virtio-gpu", width=960, height=540)

FOLDER = "/tmp/calibration"
RIG = f"{FOLDER}/rig.toml"
ENTER, MOVES = f"{FOLDER}/enter", f"{FOLDER}/moves"

# The limit for a panel with 1496 lenses is 1e-5. The same error of the phase at the edges is four
# times as much pitch on this panel with 374.
PITCH_TOLERANCE = 1e-5 * 1496 / 374
PHASE_TOLERANCE = 0.02  # lenses
PATTERN_SECONDS = 10


class Bench:
    """The guest's panel under a sheet, the camera in front of it, and the rig to start from."""

    def __init__(self, vm):
        self.vm = vm
        self.program = require_program(vm, "vm_calibration_camera")
        self.lenticule = require_program(vm, "lenticule")
        self.camera = node_called(vm, INPUT)
        vm.check(["rm", "-rf", FOLDER])
        vm.check(["mkdir", FOLDER])
        vm.check(["mkfifo", ENTER, MOVES])
        vm.check([self.program, "start", RIG])
        self.start_rig = vm.read_file(RIG)
        self.looking = self._start([self.program, "look", f"/dev/dri/card{vm.card('virtio_gpu')}",
                                    node_called(vm, OUTPUT), self.camera], MOVES)
        self.looking.wait_for_line("at 0", 300)

    def _start(self, command, pipe):
        # Opened for reading and writing: it has no end, and opening it does not wait.
        return self.vm.start(f"exec {shlex.join(command)} 0<>{pipe}")

    def calibrate(self, viewpoints, *flags, settle_ms=1500):
        return self._start([self.lenticule, "calibrate", "camera", "--rig", RIG, "-o", RIG,
                            "--display", "kms", "--device", self.camera, "--width", "640",
                            "--height", "480", "--pixel-format", "RGB3",
                            "--viewpoints", str(viewpoints), "--average", "1",
                            "--settle-ms", str(settle_ms), "--json", *flags], ENTER)

    def move_camera(self, viewpoint):
        self.vm.check(f"echo move {viewpoint} > {MOVES}")
        self.looking.wait_for_line(f"at {viewpoint}", 300)

    def press_enter(self):
        self.vm.check(f"echo > {ENTER}")

    def files(self):
        return sorted(self.vm.check(["ls", FOLDER]).stdout.split())

    def judge(self, report):
        """Returns the rig's errors against the ground truth."""
        eye = report["viewpoints"][0]["eye_mm"]
        judged = self.vm.check([self.program, "judge", RIG, *map(str, eye)], 120).stdout
        print("   ", judged, end="", flush=True)
        return json.loads(judged)


def wait_until(process, condition, timeout):
    """Waits until the condition holds; fails if the process ends before."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert process.running() and time.monotonic() < deadline, (process.stdout, process.stderr)
        time.sleep(0.2)


def check_files(bench, report):
    kept = f"{FOLDER}/rig.1.toml"
    assert report["files"]["old_rig_kept_as"] == kept, report["files"]
    assert bench.vm.read_file(kept) == bench.start_rig
    assert bench.files() == ["enter", "moves", "rig.1.toml", "rig.report.html", "rig.toml"]


def check_effective_pitches(report, truth):
    for seen, true in zip(report["viewpoints"], truth["effective_pitch_subpx"]):
        error = seen["effective_pitch_subpx"]["value"] / true - 1
        assert abs(error) < PITCH_TOLERANCE, (seen["name"], error)


def report_of(process, timeout):
    result = process.wait(timeout)
    assert result.code == 0, result
    return json.loads(result.stdout)


@vm_test(BENCH, slow=True)
def one_viewpoint_gives_the_rig_of_that_eye(vm):
    bench = Bench(vm)
    report = report_of(bench.calibrate(1, "--no-prompts"), 150 * PATTERN_SECONDS)
    truth = bench.judge(report)
    assert report["verdict"] == "effective", report["reasons"]
    check_effective_pitches(report, truth)
    assert truth["worst_lenses_at_first"][0] < PHASE_TOLERANCE, truth
    check_files(bench, report)


@vm_test(BENCH, slow=True)
def three_viewpoints_give_the_rig_of_every_eye(vm):
    bench = Bench(vm)
    calibrating = bench.calibrate(3)
    for viewpoint in range(3):
        prompt = f"Viewpoint {viewpoint + 1} of 3"
        wait_until(calibrating, lambda: prompt in calibrating.stderr, 150 * PATTERN_SECONDS)
        if viewpoint > 0:
            bench.move_camera(viewpoint)
        bench.press_enter()
    report = report_of(calibrating, 150 * PATTERN_SECONDS)
    truth = bench.judge(report)
    assert report["verdict"] == "intrinsic", report["reasons"]
    check_effective_pitches(report, truth)
    # The model is extrapolated beyond the steepest angle of any viewpoint.
    assert truth["worst_lenses"] < PHASE_TOLERANCE, truth
    check_files(bench, report)


@vm_test(BENCH, slow=True)
def an_unplugged_camera_leaves_the_rig_unchanged(vm):
    bench = Bench(vm)
    before = bench.files()
    # On a busy machine the camera may see a pattern seconds later.
    calibrating = bench.calibrate(1, "--no-prompts", settle_ms=5000)
    wait_until(calibrating, lambda: "picture 12 " in bench.looking.stdout, 20 * PATTERN_SECONDS)
    set_control(vm, bench.camera, "Disconnect", 1)
    result = calibrating.wait(60)
    assert result.code == 3, result
    assert f"camera: {bench.camera}: unplugged" in result.stderr, result
    assert "nothing was written" in result.stderr, result
    assert bench.files() == before
    assert vm.read_file(RIG) == bench.start_rig
