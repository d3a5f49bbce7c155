# SPDX-License-Identifier: Apache-2.0
"""Tests how step_network.py compares players, on recordings that are made up."""

import pathlib
import tempfile
import unittest

import comparison
from comparison import Flip, Session

LOOP = 48
PERIOD = 1 / 60
LIMIT = 1.1


def played(count, late=0.0, first=0, vblanks_of=None):
    """Returns flips of consecutive frames, `late` vblanks later than those of a player that is not late."""
    vblanks = vblanks_of or {}
    flips = []
    shift = 0
    for index in range(first, first + count):
        shift += vblanks.get(index, 0)  # this frame and the later ones come that many vblanks later
        vblank = index + shift
        flips.append(Flip((vblank + late) * PERIOD, vblank, index, index % LOOP))
    return flips


def session(player, flips, judged_from=0.0, restarted=False):
    return Session(player=player, flips=flips, judged_from=judged_from, restarted=restarted,
                   not_judged=comparison.late_spans(flips, PERIOD, 3.0))


def compared(*sessions):
    return comparison.Comparison(sessions, LOOP, PERIOD, LIMIT)


class Comparing(unittest.TestCase):
    def test_the_difference_is_the_time_between_the_appearances_of_a_frame(self):
        result = compared(session(0, played(600)), session(1, played(600, late=0.75)))
        self.assertAlmostEqual(result.largest, 0.75)
        self.assertEqual(result.compared, 600)
        self.assertEqual(result.beyond, 0)
        apart = result.seconds_apart
        self.assertAlmostEqual(apart[1] / (apart[0] + apart[1]), 0.75, 2)

    def test_a_player_that_is_too_far_is_found_whether_it_is_early_or_late(self):
        for late in (1.5, -1.5):
            result = compared(session(0, played(600)), session(1, played(600, late=late)))
            self.assertAlmostEqual(result.largest, 1.5)
            self.assertGreater(result.beyond, 590)
            self.assertIn(2, result.seconds_apart)

    def test_a_correction_is_compared(self):
        corrected = played(600, vblanks_of={300: 1})
        result = compared(session(0, played(600)), session(1, corrected, judged_from=0))
        self.assertEqual(comparison.late_spans(corrected, PERIOD, 3.0), [])
        self.assertAlmostEqual(result.largest, 1.0)

    def test_a_late_frame_is_excused_until_the_player_has_caught_up(self):
        flips = [flip for flip in played(600) if flip.index != 301]
        flips[300] = Flip(301 * PERIOD, 301, 300, 300 % LOOP)  # instead of vblank 300
        late = session(1, flips)
        self.assertEqual(len(late.not_judged), 1)
        begin, end = late.not_judged[0]
        self.assertAlmostEqual(begin, 300 * PERIOD)
        self.assertAlmostEqual(end, 302 * PERIOD)
        result = compared(session(0, played(600, late=0.3)), late)
        self.assertAlmostEqual(result.largest, 0.3)
        self.assertAlmostEqual(result.largest_with_late, 0.7)

    def test_a_player_that_does_not_catch_up_is_excused_for_the_time_of_joining_only(self):
        late = session(1, played(600, vblanks_of={100: 20}))
        self.assertEqual(len(late.not_judged), 1)
        self.assertAlmostEqual(late.not_judged[0][1] - late.not_judged[0][0], 3.0)
        self.assertAlmostEqual(compared(session(0, played(600)), late).largest, 20.0)

    def test_a_started_player_is_compared_when_it_must_be_in_step(self):
        joining = played(290, late=5.0) + played(300, first=300)
        started = session(1, joining, judged_from=300 * PERIOD, restarted=True)
        result = compared(session(0, played(600)), started)
        self.assertEqual(result.beyond, 0)
        self.assertAlmostEqual(started.apart_until, 294 * PERIOD)

    def test_mixed_frames_and_frames_backwards_are_counted(self):
        flips = played(600)
        flips[100].frame = -1
        flips[200], flips[201] = (Flip(200 * PERIOD, 200, 201, 201 % LOOP),
                                  Flip(201 * PERIOD, 201, 200, 200 % LOOP))
        result = compared(session(0, flips))
        self.assertEqual(result.torn, 1)
        self.assertEqual(result.went_back, 1)

    def test_the_last_line_of_a_killed_player_may_be_incomplete(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "flips"
            file.write_text("7 0 aa 1000000000\n8 1 bb 1016666667\n9 2 xx 1033333333\n10 3 aa 10")
            self.assertEqual(comparison.read_flips(file, {"aa": 0, "bb": 1}),
                             [Flip(1.0, 7, 0, 0), Flip(1.016666667, 8, 1, 1), Flip(1.033333333, 9, 2, -1)])


if __name__ == "__main__":
    unittest.main()
