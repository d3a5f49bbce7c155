# SPDX-License-Identifier: Apache-2.0
"""Tests the checks behind "exact", "in order" and "on time". Needs no machine."""

import contextlib
import importlib.machinery
import importlib.util
import io
import pathlib
import unittest
from fractions import Fraction

import picture
from numbered_frames import NumberedPictures
from test_cadence import FRAMES, shown_frames, unplanned_repeats
from test_frames import changes
from vkms import FrameCrc
from vm import Machine, MachineStalled, VmError
from vm_test import Test

REFRESH = Fraction(60)
NUMBERS = {1000 + number: number for number in range(FRAMES)}


class Numbers(unittest.TestCase):
    def setUp(self):
        self.pictures = NumberedPictures(picture.noise(16, 9, seed=1))

    def test_any_two_frames_differ_in_every_pixel(self):
        for one, other in [(0, 1), (7, 8), (255, 256), (3, 3 + 256), (10, 10 + 7 * 256)]:
            self.assertEqual(picture.differing_pixels(self.pictures.frame(one),
                                                      self.pictures.frame(other)), 16 * 9)

    def test_a_frame_is_itself_only(self):
        for number in [0, 1, 299, 300]:
            self.assertTrue(self.pictures.shown_in(self.pictures.frame(number), number))
            self.assertFalse(self.pictures.shown_in(self.pictures.frame(number), number + 1))
        self.assertFalse(self.pictures.shown_in(picture.noise(9, 16, seed=1), 0))

    def test_a_row_of_another_frame_is_noticed(self):
        old, new = self.pictures.frame(4), self.pictures.frame(5)
        torn = picture.Picture(16, 9, new.rgb[:8 * 48] + old.rgb[8 * 48:])
        with self.assertRaisesRegex(AssertionError, "frame 5 is due, the first pixel says 5: 16 of"):
            self.pictures.assert_shown_in(torn, 5)


def composed(vblanks_per_frame, first=500):
    """Returns checksums of frames 0, 1, 2 ..., each shown for a number of vblanks."""
    crcs = [7, 7]
    for number, vblanks in enumerate(vblanks_per_frame):
        crcs += [1000 + number % FRAMES] * vblanks
    return [FrameCrc(first + at, crc) for at, crc in enumerate(crcs + [7])]


def judged(frames, rate):
    return unplanned_repeats(shown_frames(frames, NUMBERS), REFRESH, Fraction(rate))


class Cadences(unittest.TestCase):
    def test_two_and_three_is_what_24_means(self):
        self.assertEqual(judged(composed([2, 3] * 40), 24), 0)

    def test_a_repeat_counts_once_however_long_it_plays_on(self):
        self.assertEqual(judged(composed([2, 3, 2, 4] + [2, 3] * 40), 24), 1)
        self.assertEqual(judged(composed([1] * 30 + [3] + [1] * 70), 60), 2)

    def test_a_frame_too_early_is_wrong_though_the_next_makes_up_for_it(self):
        with self.assertRaises(AssertionError):
            judged(composed([2, 3, 1, 4] + [2, 3] * 4), 24)

    def test_a_dropped_frame_is_wrong(self):
        frames = composed([2] * 10)
        with self.assertRaises(AssertionError):
            judged([f if f.crc != 1004 else FrameCrc(f.vblank, 1003) for f in frames], 30)

    def test_a_foreign_picture_or_a_vblank_without_one_is_wrong(self):
        frames = composed([2] * 10)
        with self.assertRaises(AssertionError):
            judged(frames[:9] + [FrameCrc(frames[9].vblank, 7)] + frames[10:], 30)
        with self.assertRaisesRegex(AssertionError, "a vblank was skipped"):
            judged(frames[:9] + frames[10:], 30)

    def test_changes_are_what_came_after_something_else(self):
        self.assertEqual(changes([1, 1, 2, 2, 1]), [1, 2, 1])


def load_runner():
    path = str(pathlib.Path(__file__).with_name("run"))
    loader = importlib.machinery.SourceFileLoader("run", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("run", loader))
    loader.exec_module(module)
    return module


class Bench:
    """Replaces machines and counts them."""

    def __init__(self):
        self.booted = 0
        self._up = False

    def for_test(self, _):
        self.booted += not self._up
        self._up = True
        return self

    def drop(self):
        self._up = False

    def logs(self):
        return ""

    def end_processes(self):
        pass


class Runner(unittest.TestCase):
    def outcome(self, *problems):
        """Returns counts after a test with these problems, one per attempt, and machines used."""
        runner, bench, left = load_runner(), Bench(), list(problems)

        def function(_):
            if left:
                raise left.pop(0)

        tally, printed = runner.Tally(), io.StringIO()
        with contextlib.redirect_stdout(printed):
            runner.run_test(Test("a.b", Machine(), False, False, function), bench, tally)
            tally.close()
        counts = tally.counts
        return counts["passed"], counts["failed"], bench.booted, printed.getvalue()

    def test_a_machine_that_stalls_is_replaced_once_and_shown(self):
        self.assertEqual(self.outcome()[:3], (1, 0, 1))
        passed, failed, booted, printed = self.outcome(MachineStalled("its kernel says x"))
        self.assertEqual((passed, failed, booted), (1, 0, 2))
        self.assertIn("stalled", printed)
        self.assertIn("its kernel says x", printed)
        self.assertIn("were replaced: 1", printed)

    def test_two_machines_that_stall_are_a_failure(self):
        self.assertEqual(self.outcome(MachineStalled("x"), MachineStalled("y"))[:3], (0, 1, 2))

    def test_whatever_else_goes_wrong_is_a_failure_at_once(self):
        for problem in [VmError("the machine ended by itself"), AssertionError("not exact")]:
            self.assertEqual(self.outcome(problem)[:3], (0, 1, 1))


if __name__ == "__main__":
    unittest.main()
