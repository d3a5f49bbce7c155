#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Plays a film in step on eight players over a bad network, and measures how far they are apart.

Each player is a process `lenticule play --step` in a network namespace of its own, with a virtual panel
at 60 Hz whose period differs from the others' by up to 200 ppm. A relay between the namespaces loses,
delays, doubles, damages and replays messages. The leader is killed and started again, and clocks are
stepped by 2 s. Every player records which frame it displayed at which vblank. At the end the relay
replays messages to players that hear nothing else: none may be accepted.

A started player is not compared before it had {REJOIN} s to come into step, with a clock that is right.
A player that displays a frame late, because the machine is busy, is not compared until it has caught up.

Exit code: 0 if all bounds hold, 1 if one is broken, 77 if the system permits no network namespaces.
"""

import argparse
import heapq
import itertools
import json
import mmap
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

import comparison
import network

RATE = 60
LOOP = 48            # frames: a player needs at most twice the loop, 1.6 s, to come into step
REJOIN = 3.0         # seconds after the first frame of a started player
SETTLE = 5.0         # seconds after the first frame of the whole group
STATISTICS = 2.2     # seconds after which a player has written its statistics
SILENCE = 2.5        # seconds after which a peer counts as gone
CLOCK_STEP = 2.0
REPLAYS_PER_SECOND = 10
REPLAYS_AT_END = 50  # messages for each player
PANEL_PPM = 100
# Each of two players may be 0.05 vblank beyond its vblank.
LIMIT = 1.10
RIG = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "rigs" / "tiny.toml"
WIDTH, HEIGHT = 48, 32


class Scheduler:
    """Scheduler runs actions at their times, and the relay between them."""

    def __init__(self):
        self._actions = []
        self._numbers = itertools.count()
        self.relay = None

    @staticmethod
    def now():
        return time.monotonic()

    def after(self, seconds, action):
        heapq.heappush(self._actions, (self.now() + seconds, next(self._numbers), action))

    def run(self, seconds):
        end = self.now() + seconds
        while self.now() < end:
            while self._actions and self._actions[0][0] <= self.now():
                heapq.heappop(self._actions)[2]()
            next_time = min(end, self._actions[0][0]) if self._actions else end
            self.relay.wait(next_time - self.now())

    def run_until(self, condition, seconds, what):
        end = self.now() + seconds
        while not condition():
            if self.now() > end:
                raise SystemExit(f"after {seconds} s: not {what}")
            self.run(0.05)


class Clock:
    """Clock is the time of day of one player."""

    def __init__(self, file):
        file.write_bytes(bytes(8))
        self.file = file
        with open(file, "r+b") as opened:
            self._memory = mmap.mmap(opened.fileno(), 8)
        self.changes = 0
        self.corrections = []  # times at which the clock was right again
        self.wrong = False

    def step(self, seconds, now):
        shift = struct.unpack("q", self._memory[:])[0] + int(seconds * 1e9)
        self._memory[:] = struct.pack("q", shift)
        self.changes += 1
        self.wrong = shift != 0
        if not self.wrong:
            self.corrections.append(now)


class Player:
    def __init__(self, number, namespace, folder, words, library):
        self.number = number
        self.namespace = namespace
        self.folder = folder
        folder.mkdir()
        self.clock = Clock(folder / "clock")
        self._words = words
        self._environment = dict(os.environ, LD_PRELOAD=str(library),
                                 LENTICULE_CLOCK_SHIFT=str(self.clock.file))
        self.process = None
        self.starts = []  # (time, clock was wrong)

    def start(self, now):
        name = self.folder / str(len(self.starts))
        self.starts.append((now, self.clock.wrong))
        with self.namespace, open(f"{name}.err", "w") as err:
            self.process = subprocess.Popen(
                [*self._words, "--stats", f"{name}.json", "--record", f"times:{name}.flips"],
                env=self._environment, stdin=subprocess.DEVNULL, stdout=err, stderr=err)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def statistics(self):
        try:
            return json.loads((self.folder / f"{len(self.starts) - 1}.json").read_text())
        except (OSError, ValueError):
            return {}

    def messages(self):
        return self.statistics().get("step", {}).get("messages", {})

    def recordings(self):
        return [self.folder / f"{k}.flips" for k in range(len(self.starts))]


def write_pictures(folder):
    """Writes frames of which each row is unique, so that a mixture of two frames is noticed."""
    folder.mkdir()
    for frame in range(LOOP):
        rows = b"".join(b"\0" + bytes([(frame * 37 + row * 5) % 256, frame, row] * WIDTH)
                        for row in range(HEIGHT))

        def chunk(kind, content):
            return (struct.pack(">I", len(content)) + kind + content
                    + struct.pack(">I", zlib.crc32(kind + content)))
        (folder / f"{frame:02}.png").write_bytes(
            b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Run:
    def __init__(self, options, folder):
        self.options = options
        self.folder = folder
        self.random = random.Random(options.seed)
        self.scheduler = Scheduler()
        write_pictures(folder / "film")
        subprocess.run([options.lenticule, "convert", folder / "film" / "%02d.png", "--rig", RIG,
                        "--rate", str(RATE), "-o", folder / "film.lts"],
                       check=True, capture_output=True, timeout=120)
        (folder / "step.key").write_bytes(os.urandom(32))
        (folder / "step.key").chmod(0o600)
        self.film = self._checksums_of_film()
        namespaces = [network.Namespace() for _ in range(options.players)]
        self.relay = network.Relay(namespaces[0], namespaces[1:], self.scheduler, self.random)
        self.scheduler.relay = self.relay
        self.players = [Player(k, namespace, folder / f"player-{k}", self._words(k), options.clock_shift)
                        for k, namespace in enumerate(namespaces)]
        self.leader, self.followers = self.players[0], self.players[1:]
        self.kills = 0
        self.clock_steps = 0
        self.at_end = {}

    def _checksums_of_film(self):
        """Returns frame number by checksum, from a run without clock, network and other players."""
        file = self.folder / "film.txt"
        subprocess.run([self.options.lenticule, "play", self.folder / "film.lts", "--rig", RIG,
                        "--display", f"virtual:{WIDTH}x{HEIGHT}@{RATE}",
                        "--clock", "simulated", "--record", f"checksums:{file}"],
                       check=True, capture_output=True, timeout=120)
        lines = [line.split() for line in file.read_text().splitlines() if not line.startswith("#")]
        film = {checksum: int(frame) for _, frame, checksum in lines}
        if sorted(film.values()) != list(range(LOOP)):
            raise SystemExit(f"the film has {len(film)} different frames instead of {LOOP}")
        return film

    def _words(self, number):
        ppm = PANEL_PPM * (2 * number / (self.options.players - 1) - 1)
        return [self.options.lenticule, "play", str(self.folder / "film.lts"), "--rig", str(RIG),
                "--display", f"virtual:{WIDTH}x{HEIGHT}@{RATE * (1 + ppm * 1e-6):.6f}",
                "--loop", "forever", "--step", "wall", "--follow" if number else "--leader",
                "--step-address", f"127.0.0.1:{network.PORT}", "--step-key", str(self.folder / "step.key")]

    # --- what happens ---------------------------------------------------------------------------

    def play(self):
        now = self.scheduler.now()
        for player in self.players:
            player.start(now)
        self.scheduler.run_until(lambda: all(p.recordings()[0].exists() and p.recordings()[0].stat().st_size
                                             for p in self.players), 60, "every player displays the film")
        self.judged_from = self.scheduler.now() + SETTLE
        self.scheduler.run(SETTLE)
        length = self.options.minutes * 60
        self._plan(length)
        self.scheduler.run(length)
        self.judged_until = self.scheduler.now()
        self._replay_at_the_end()

    def _plan(self, length):
        kills = self.options.kills
        for kill in range(kills):
            # The leader plays again before the end.
            when = (kill + self.random.uniform(0.2, 0.4)) * length / kills
            pause = self.random.uniform(0.05, min(3.0, 0.5 * length / kills))
            self.scheduler.after(when, self._kill_leader)
            self.scheduler.after(when + pause, lambda: self.leader.start(self.scheduler.now()))
        every = min(20.0, length / 4)
        for k in range(1, int(length / every)):
            player = self.random.choice(self.players)
            step = self.random.choice((CLOCK_STEP, -CLOCK_STEP))
            pause = self.random.uniform(1, min(11, every - 1))
            for when, by in ((k * every, step), (k * every + pause, -step)):
                self.scheduler.after(when, lambda player=player, by=by: self._step_clock(player, by))

        for k in range(int(length * REPLAYS_PER_SECOND)):
            self.scheduler.after(k / REPLAYS_PER_SECOND, self.relay.replay_one)

    def _kill_leader(self):
        self.leader.kill()
        self.kills += 1

    def _step_clock(self, player, seconds):
        player.clock.step(seconds, self.scheduler.now())
        self.clock_steps += 1

    def _replay_at_the_end(self):
        """Replays messages to players that hear nothing else, and to a leader that was just started."""
        self.relay.open = False
        self.leader.kill()
        self.scheduler.run(SILENCE + STATISTICS)
        before = [player.messages() for player in self.followers]
        self.at_end["followers"] = [player.statistics() for player in self.followers]
        self.at_end["delivered"] = [(path.delivered, path.damaged, path.repeated)
                                    for path in self.relay.to_follower]
        self._replay_to(self.relay.to_follower)
        self.scheduler.run(STATISTICS)
        accepted = [after["accepted"] - start["accepted"] for start, after
                    in zip(before, (player.messages() for player in self.followers))]
        refused = [refusals(player.messages()) - refusals(start) for start, player
                   in zip(before, self.followers)]
        self.leader.start(self.scheduler.now())
        self.scheduler.run_until(lambda: self.leader.statistics().get("step"), 30, "the leader plays again")
        self._replay_to(self.relay.to_leader)
        self.scheduler.run(STATISTICS)
        heard = self.leader.messages()
        self.at_end["replays_accepted"] = sum(accepted) + heard["accepted"]
        self.at_end["replays_refused"] = sum(refused) + refusals(heard)
        self.at_end["replays_sent"] = 2 * REPLAYS_AT_END * len(self.followers)

    def _replay_to(self, paths):
        for path in paths:
            for _ in range(REPLAYS_AT_END if path.remembered else 0):
                self.relay.replay(path, self.random.choice(path.remembered)[1])
            self.scheduler.run(0.1)

    def stop(self):
        for player in self.players:
            if player.process and player.process.poll() is None:
                player.kill()

    # --- what is measured -----------------------------------------------------------------------

    def sessions(self):
        for player in self.players:
            for number, (file, (_, wrong_clock)) in enumerate(zip(player.recordings(), player.starts)):
                flips = [flip for flip in comparison.read_flips(file, self.film)
                         if flip.time < self.judged_until] if file.exists() else []
                if not flips:
                    continue
                judged = self.judged_from if number == 0 else flips[0].time + REJOIN
                if wrong_clock:
                    judged = max(judged, self._right_after(player, flips[0].time) + REJOIN)
                period = 1.0 / RATE
                yield comparison.Session(
                    player=player.number, flips=flips, judged_from=judged, restarted=number > 0,
                    not_judged=comparison.late_spans(flips, period, REJOIN))

    @staticmethod
    def _right_after(player, moment):
        """Returns when the clock was right again that was wrong at this moment."""
        return next((when for when in player.clock.corrections if when > moment), float("inf"))

    def report(self):
        sessions = list(self.sessions())
        result = comparison.Comparison(sessions, LOOP, 1.0 / RATE, LIMIT)
        statistics = self.at_end["followers"]
        steps = [figures["step"] for figures in statistics]
        spans = [len(session.not_judged) for session in sessions if session.player > 0]
        joins = [session.apart_until - session.flips[0].time for session in sessions
                 if session.restarted and session.flips[-1].time > session.judged_from
                 and session.judged_from < session.flips[0].time + 1.5 * REJOIN]
        seconds = sum(result.seconds_apart.values())
        delivered = self.at_end["delivered"]
        return {
            "players": len(self.players), "minutes": self.options.minutes, "kills": self.kills,
            "clock_steps": self.clock_steps, "messages": dict(self.relay.counts),
            "largest_difference_vblanks": round(result.largest, 4),
            "largest_difference_with_late_frames_vblanks": round(result.largest_with_late, 4),
            "compared": result.compared, "beyond_limit": result.beyond,
            "percent_of_time_by_frames_apart": {
                str(apart): round(100 * result.seconds_apart[apart] / seconds, 4)
                for apart in sorted(result.seconds_apart)},
            "torn": result.torn, "went_back": result.went_back,
            "late_frames": sum(spans),
            "late_frames_by_own_count": sum(figures["missed_vblanks"] + figures["repeated_underrun"]
                                            for figures in statistics),
            "longest_join_s": round(max(joins, default=0.0), 2), "joins": len(joins),
            "followers_joined": [step["joined"] for step in steps],
            "largest_own_difference_vblanks": max(step["largest_difference_vblanks"] for step in steps),
            "clock_steps_seen": sum(step["clock"]["steps"] for step in steps),
            "clock_steps_of_followers": sum(player.clock.changes for player in self.followers),
            "messages_accepted": sum(step["messages"]["accepted"] for step in steps),
            "damaged_delivered": sum(damaged for _, damaged, _ in delivered),
            "damaged_refused": sum(step["messages"]["refused_key"] for step in steps),
            "repeated_delivered": sum(repeated for _, _, repeated in delivered),
            "repeated_refused": sum(refusals(step["messages"]) - step["messages"]["refused_key"]
                                    for step in steps),
            "replays_at_end": self.at_end["replays_sent"],
            "replays_at_end_accepted": self.at_end["replays_accepted"],
            "replays_at_end_refused": self.at_end["replays_refused"],
            "examples": [{"time": when, "players": [one, other], "frame": frame, "vblanks": round(apart, 3)}
                         for when, one, other, frame, apart in result.examples[:20]],
        }


def refusals(messages):
    return sum(count for key, count in messages.items() if key.startswith("refused_"))


def bounds(report):
    """Returns (what, measured, bound, held) of each bound."""
    return [
        ("largest difference in vblanks", f"{report['largest_difference_vblanks']:.3f}", f"<= {LIMIT}",
         report["largest_difference_vblanks"] <= LIMIT),
        ("torn frames", report["torn"], "0", report["torn"] == 0),
        ("frames that went back", report["went_back"], "0", report["went_back"] == 0),
        ("compared pairs of frames", report["compared"], "> 1000", report["compared"] > 1000),
        ("longest way into step after a start, seconds", report["longest_join_s"], f"<= {REJOIN}",
         report["longest_join_s"] <= REJOIN),
        ("damaged messages refused", report["damaged_refused"], f"{report['damaged_delivered']}",
         report["damaged_refused"] == report["damaged_delivered"]),
        ("doubled and replayed messages refused", report["repeated_refused"],
         f">= {report['repeated_delivered']}",
         report["repeated_refused"] >= report["repeated_delivered"]),
        ("replays accepted in a silent network", report["replays_at_end_accepted"], "0",
         report["replays_at_end_accepted"] == 0),
        ("replays refused in a silent network", report["replays_at_end_refused"],
         f"{report['replays_at_end']}", report["replays_at_end_refused"] == report["replays_at_end"]),
        ("clock steps seen by followers", report["clock_steps_seen"],
         f"{report['clock_steps_of_followers']}",
         report["clock_steps_seen"] == report["clock_steps_of_followers"]),
    ]


def print_table(report, rows):
    messages = report["messages"]
    print(f"{report['players']} players at {RATE} Hz for {report['minutes']:g} minutes; "
          f"leader killed {report['kills']} times; {report['clock_steps']} clock steps of {CLOCK_STEP:g} s")
    print("messages: " + ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in messages.items()))
    print()
    for what, measured, bound, held in rows:
        print(f"{what:46} {measured!s:>10}  {bound:12} {'' if held else 'BROKEN'}")
    print()
    print("frames apart at one instant: " + ", ".join(
        f"{apart}: {percent} % of the time"
        for apart, percent in report["percent_of_time_by_frames_apart"].items()))
    print(f"late frames of followers, not compared: {report['late_frames']}; by their own count "
          f"{report['late_frames_by_own_count']}; largest difference with them: "
          f"{report['largest_difference_with_late_frames_vblanks']:.3f} vblanks")


def parse(arguments):
    parser = argparse.ArgumentParser(
        description=__doc__.replace("{REJOIN}", f"{REJOIN:g}"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Example:\n  tests/step/step_network.py --build build/release --minutes 10 --kills 100")
    parser.add_argument("--build", type=pathlib.Path, default=pathlib.Path("build/release"),
                        help="folder of the build (default: build/release)")
    parser.add_argument("--lenticule", type=pathlib.Path, help="the program, instead of the build's")
    parser.add_argument("--clock-shift", type=pathlib.Path,
                        help="the library step_clock_shift, instead of the build's")
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the comparison (default: 10)")
    parser.add_argument("--kills", type=int, default=100, help="kills of the leader (default: 100)")
    parser.add_argument("--players", type=int, default=8, help="players with the leader (default: 8)")
    parser.add_argument("--seed", type=int, default=1, help="seed of what happens (default: 1)")
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")
    parser.add_argument("--keep", type=pathlib.Path, metavar="FOLDER",
                        help="keep recordings, statistics and messages of the players in a new folder")
    options = parser.parse_args(arguments)
    options.lenticule = (options.lenticule or options.build / "lenticule").resolve()
    options.clock_shift = (options.clock_shift
                           or options.build / "tests" / "step" / "libstep_clock_shift.so").resolve()
    for file in (options.lenticule, options.clock_shift):
        if not file.exists():
            parser.error(f"{file}: missing; build the targets lenticule_program and step_clock_shift")
    return options


def main():
    options = parse(sys.argv[1:])
    try:
        network.enter_user_namespace()
        network.Namespace()
    except network.NotPermitted as error:
        print(f"skipped: this system does not permit {error}")
        return 77
    folder = options.keep or pathlib.Path(tempfile.mkdtemp(prefix="step-network-"))
    folder.mkdir(exist_ok=options.keep is None)
    run = None
    try:
        run = Run(options, folder.resolve())
        run.play()
        report = run.report()
    finally:
        if run:
            run.stop()
        if not options.keep:
            shutil.rmtree(folder)
    rows = bounds(report)
    if options.json:
        print(json.dumps(report, indent=1))
    else:
        print_table(report, rows)
    broken = [what for what, _, _, held in rows if not held]
    for what in broken:
        print(f"bound broken: {what}", file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
