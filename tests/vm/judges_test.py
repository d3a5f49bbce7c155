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
from hostile_list import DAMAGED, LEFT_OUT, Item, some_of_each_kind
from numbered_frames import NumberedPictures
from test_cadence import FRAMES, shown_frames, unplanned_repeats
from test_frames import changes
from test_hostile import UNSEEN, check_pictures, check_reports, owners_of, recorded, without_console
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


def hostile_items():
    """Returns a good item of two frames, a bad one, a damaged one of one frame, and another good one."""
    pictures = [picture.noise(4, 4, seed) for seed in range(6)]
    return [Item("good", "/a.lts", pictures[:2]), Item("bad", "/bad.png", [], (LEFT_OUT,)),
            Item("damaged", "/b.lts", pictures[2:3], (DAMAGED,), also=pictures[3:4]),
            Item("good", "/\x1bc.png", pictures[4:5])]


class HostileLists(unittest.TestCase):
    REPORTS = ("playing: 1 frames\nleft out: /bad.png: truncated\n"
               "damaged: /b.lts: 1 frames damaged, 0 missing, 0 repeated\n")

    def setUp(self):
        self.items = hostile_items()
        self.good = [item for item in self.items if item.pictures]
        self.owners = owners_of(self.good)
        self.a, self.a2, self.b, self.b_also, self.c = list(self.owners)

    def rounds(self, *composed):
        return check_pictures(composed, self.good, self.owners)

    def test_every_frame_in_order_is_a_round(self):
        self.assertEqual(self.rounds(self.a, self.a, self.a2, self.b, self.b_also, self.c), 1)
        self.assertEqual(self.rounds(self.a, self.a2, self.b, self.c, self.a, self.b, self.c), 2)

    def test_a_picture_of_no_item_is_wrong(self):
        with self.assertRaisesRegex(AssertionError, "(?s)1 pictures are of no item:.* 2 times no item .00000007"):
            self.rounds(self.a, self.a2, 7, 7, self.b, self.c)

    def test_an_item_or_a_frame_that_is_not_shown_is_wrong(self):
        with self.assertRaisesRegex(AssertionError, "in place of /b.lts"):
            self.rounds(self.a, self.a2, self.c)
        with self.assertRaisesRegex(AssertionError, r"/a.lts: frames \[1\] were not shown"):
            self.rounds(self.a, self.b, self.c)

    def test_pictures_of_the_console_are_accepted_only_before_the_first_item_and_after_the_last(self):
        self.assertEqual(without_console([7, self.a, 7, self.b, 7, 7], self.owners),
                         [self.a, 7, self.b])

    def test_looks_are_read_as_they_were_written(self):
        self.assertEqual(recorded("0000000a 2 0 0.00\nffffffff 1 3 0.20\n0000000b 1 0 0.45\n"),
                         ([10, 10, 0xFFFFFFFF, UNSEEN, 11], 3))

    def test_a_frame_may_be_missing_only_in_a_time_without_a_look(self):
        self.assertEqual(self.rounds(self.a, UNSEEN, self.b, self.c), 1)
        self.assertEqual(self.rounds(self.a, self.a2, self.b, UNSEEN, self.c), 1)
        with self.assertRaisesRegex(AssertionError, r"/a.lts: frames \[1\] were not shown"):
            self.rounds(self.a, self.b, UNSEEN, self.c)
        with self.assertRaisesRegex(AssertionError, "in place of /b.lts"):
            self.rounds(self.a, UNSEEN, self.c)

    def test_equal_pictures_of_two_items_are_refused(self):
        with self.assertRaisesRegex(AssertionError, "look alike"):
            owners_of([self.good[0], self.good[0]])

    def test_each_bad_item_is_reported_once_and_no_other(self):
        self.assertEqual(check_reports(self.REPORTS, self.items), 2)
        for wrong in [self.REPORTS * 2, "", self.REPORTS.replace("damaged: ", "left out: "),
                      self.REPORTS + "left out: /a.lts: truncated\n",
                      self.REPORTS + "left out: /\\x1bc.png: truncated\n"]:
            with self.assertRaises(AssertionError):
                check_reports(wrong, self.items)

    def test_a_decoder_that_died_is_wrong(self):
        with self.assertRaisesRegex(AssertionError, "a decoder died"):
            check_reports(self.REPORTS.replace("truncated", "its decoder was ended by signal 11"),
                          self.items)

    def test_some_of_each_kind_are_the_first_the_last_and_others_between(self):
        items = [Item("x", str(number), []) for number in range(10)] + [Item("y", "10", [])]
        self.assertEqual([item.source for item in some_of_each_kind(items, 3)], ["0", "4", "9", "10"])
        self.assertEqual(some_of_each_kind(items, 100), items)


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

    def processor_seconds(self):
        return 0.0

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
            runner.run_test(Test("a.b", Machine(), False, False, (), function), bench, tally)
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
