# SPDX-License-Identifier: Apache-2.0
"""Compares what players displayed: how far apart in time one frame appeared on their panels."""

import bisect
import dataclasses
import math

LATE_RETURNS_WITHIN = 30  # vblanks; corrections of players in step are at least 60 vblanks apart


@dataclasses.dataclass
class Flip:
    time: float   # seconds, CLOCK_MONOTONIC
    vblank: int
    index: int    # number of the frame over all loops
    frame: int    # number within the film, by the checksum of its pixels; -1: not a frame of the film


@dataclasses.dataclass
class Session:
    """Session holds what one process displayed."""
    player: int
    flips: list
    judged_from: float        # time from which the player must be in step
    restarted: bool = False   # a start beside a group that plays
    apart_until: float = 0.0  # last time at which the player was too far from those in step
    not_judged: list = dataclasses.field(default_factory=list)  # times (from, to) with a late frame


def read_flips(file, film):
    """Reads a recording of `times:FILE`. `film` maps checksums to numbers of frames."""
    flips = []
    for line in file.read_text().split("\n")[:-1]:  # the last line of a killed player may be incomplete
        vblank, index, checksum, time = line.split()
        flips.append(Flip(int(time) * 1e-9, int(vblank), int(index), film.get(checksum, -1)))
    return flips


def late_spans(flips, period, longest):
    """Returns the times (from, to) in which a player was behind its own schedule, in order: a frame
    stayed too long, and frames were left out soon afterwards. Corrections towards the group do not
    return."""
    spans = []
    lags = [flip.vblank - flip.index for flip in flips]
    k = 1
    while k < len(flips):
        behind = lags[k] - lags[k - 1]
        if behind > 0:
            begin = flips[k - 1].time + period
            back = next((at for at in range(k, min(k + LATE_RETURNS_WITHIN, len(flips)))
                         if lags[at] <= lags[k - 1]), None)
            if back:
                spans.append((begin, flips[back].time))
                k = back
            elif behind > 1:  # too late to catch up: the player must join again
                spans.append((begin, begin + longest))
                while k + 1 < len(flips) and flips[k + 1].time < begin + longest:
                    k += 1
        k += 1
    return spans


def _within(spans, time):
    place = bisect.bisect_right(spans, (time, math.inf)) - 1
    return place >= 0 and time <= spans[place][1]


class Comparison:
    """Comparison compares all flips in the order of time."""

    def __init__(self, sessions, loop, period, limit):
        self.loop, self.period, self.limit = loop, period, limit
        self.largest = 0.0            # vblanks between the appearances of a frame on two panels
        self.largest_with_late = 0.0  # the same with frames that were late
        self.compared = 0
        self.beyond = 0               # comparisons beyond the limit
        self.torn = 0                 # displayed pixels that are no frame of the film
        self.went_back = 0
        self.seconds_apart = {}       # frames between the first and the last player -> seconds
        self.examples = []
        self._shown = {}              # player -> session, flip
        self._appeared = {}           # player -> frame -> time
        self._run(sessions)

    def _run(self, sessions):
        flips = sorted(((flip.time, session.player, number, flip)
                        for number, session in enumerate(sessions) for flip in session.flips),
                       key=lambda entry: entry[:3])
        last_of_player = {}
        for k, (time, player, number, flip) in enumerate(flips):
            session = sessions[number]
            if last_of_player.get(player) is not session:
                last_of_player[player] = session
                self._shown.pop(player, None)
                self._appeared[player] = {}
            if flip.frame < 0 or flip.frame != flip.index % self.loop:
                self.torn += 1
                continue
            before = self._shown.get(player)
            if before and not 0 < (flip.frame - before[1].frame) % self.loop <= self.loop // 2:
                self.went_back += 1
            self._shown[player] = session, flip
            self._appeared[player][flip.frame] = time
            self._compare(session, flip)
            if k + 1 < len(flips):
                self._measure_instant(time, flips[k + 1][0])

    def _others(self, session, time):
        """Returns the other players that display something now, with their sessions."""
        for player, (other, flip) in self._shown.items():
            if player != session.player and flip.time > time - self.loop * self.period:
                yield player, other

    def _compare(self, session, flip):
        judged = flip.time >= session.judged_from
        late = judged and _within(session.not_judged, flip.time)
        for player, other in self._others(session, flip.time):
            appeared = self._appeared[player].get(flip.frame)
            if appeared is None:
                continue
            apart = (flip.time - appeared) / self.period
            if apart > self.loop / 2:  # not yet shown in this loop, or left out
                continue
            other_judged = appeared >= other.judged_from
            if judged and other_judged:
                self.largest_with_late = max(self.largest_with_late, apart)
                if late or _within(other.not_judged, appeared):
                    continue
                self.compared += 1
                self.largest = max(self.largest, apart)
                if apart > self.limit:
                    self.beyond += 1
                    self.examples.append((flip.time, session.player, player, flip.frame, apart))
            elif apart > self.limit:
                if not judged and other_judged and session.restarted:
                    session.apart_until = flip.time
                if judged and not other_judged and other.restarted:
                    other.apart_until = flip.time

    def _measure_instant(self, begin, end):
        """Notes how many frames apart the players in step are until the next flip."""
        reference, leads = None, []
        for session, flip in self._shown.values():
            ended = begin > session.flips[-1].time
            if ended or begin < session.judged_from or _within(session.not_judged, begin):
                continue
            reference = flip.frame if reference is None else reference
            half = self.loop // 2
            leads.append((flip.frame - reference + half) % self.loop - half)
        if len(leads) > 1:
            spread = max(leads) - min(leads)
            self.seconds_apart[spread] = self.seconds_apart.get(spread, 0.0) + end - begin
