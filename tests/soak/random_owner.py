#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Treats a player as a careless owner does, at random, and watches what its panel shows.

The owner loads, seeks, pauses, trims, blanks; copies films over the one that plays, cuts them off, fills
them with noise, moves them away; fills the disk of the statistics; kills and stops the decoder; opens the
page. Two rules hold all the time:

- the player never ends;
- while it says that it plays, the panel never stands still for more than 2 s unless the status names a
  problem and the log has a line of it.

With --clock simulated, which cannot be controlled, the owner only meddles with files and decoders, and the
state is read from the statistics.

Prints what was done and how long the longest standstill was; also when Ctrl-C ends it. Exit code: 0 if both rules hold, else 1.
"""

import argparse
import json
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

RIG = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "rigs" / "tiny.toml"
STILL_LIMIT = 2.0     # seconds
NOTICE = 1.5          # seconds that a standstill may be older before status and log must name it
ANSWER_LIMIT = 20.0   # seconds in which the player must answer
EXPECTED_STILL = ("paused", "off")


class Log:
    """Log keeps the lines of a process's standard error, each with the time at which it came."""

    def __init__(self, pipe):
        self.lines = []
        self._thread = threading.Thread(target=self._read, args=(pipe,), daemon=True)
        self._thread.start()

    def _read(self, pipe):
        for line in pipe:
            self.lines.append((time.monotonic(), line.rstrip("\n")))

    def since(self, moment):
        return [line for at, line in self.lines if at >= moment]


class Control:
    """Control is one connection to the player's control socket."""

    def __init__(self, path):
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(ANSWER_LIMIT)
        self._socket.connect(str(path))
        self._file = self._socket.makefile("rw")

    def ask(self, verb, **fields):
        self._file.write(json.dumps({"do": verb, **fields}) + "\n")
        self._file.flush()
        line = self._file.readline()
        if not line:
            raise ConnectionError("the player closed the control connection")
        return json.loads(line)

    def tell(self, verb, **fields):
        """Sends a request whose answer may come late, and closes the connection."""
        self._file.write(json.dumps({"do": verb, **fields}) + "\n")
        self._file.flush()
        self._socket.close()


class Stage:
    """Stage is the folder of films, the player, and what the owner does to them."""

    def __init__(self, arguments, folder):
        self.lenticule = arguments.lenticule
        self.folder = folder
        self.random = random.Random(arguments.seed)
        self.socket = folder / "control.sock"
        self.rig = folder / "rig.toml"
        shutil.copy(RIG, self.rig)
        self.make_films()
        self.statistics = folder / "small"
        self.statistics.mkdir()
        self.may_mount = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(self.statistics)],
            capture_output=True, check=False).returncode == 0
        self.controlled = arguments.clock == "real"
        self.player = subprocess.Popen(
            [self.lenticule, "play", str(folder / "list.toml"), "--rig", str(self.rig),
             "--display", "virtual:48x32@60", "--loop", "forever",
             "--stats", str(self.statistics / "stats.json"),
             *(["--control", str(self.socket)] if self.controlled else ["--clock", "simulated"])],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.log = Log(self.player.stderr)
        self.page = None

    def run(self, *words):
        result = subprocess.run([self.lenticule, *map(str, words)], capture_output=True, text=True,
                                check=False)
        if result.returncode != 0:
            raise SystemExit(f"{' '.join(map(str, words))}: {result.stderr}")

    def make_films(self):
        kept = self.folder / "kept"
        kept.mkdir()
        for name, scene in (("a", "balls"), ("b", "demo")):
            self.run("render", f"builtin:{scene}", "--rig", self.rig, "--frames", "0:24",
                     "-o", kept / f"{name}.lts")
        for name, start in (("a", 0), ("b", 8)):
            views = self.folder / f"views-{name}"
            views.mkdir()
            for frame in range(16):
                (views / f"{frame:03d}.ppm").write_bytes(self.quilt(start + frame))
            self.run("convert", views / "%03d.ppm", "--grid", "2x2", "--aspect", "1.5",
                     "--as", "quilt", "-o", kept / f"{name}.mkv")
            next(kept.glob(f"{name}_*.mkv")).rename(kept / f"{name}_qs2x2a1.5.mkv")
        (self.folder / "frames").mkdir()
        for frame in range(12):
            (self.folder / "frames" / f"{frame:03d}.ppm").write_bytes(
                self.picture(48, 32, frame * 17))
        (self.folder / "still.ppm").write_bytes(self.picture(48, 32, 99))
        self.films = {"film.lts": ("a.lts", "b.lts"),
                      "other.lts": ("b.lts", "a.lts"),
                      "clip_qs2x2a1.5.mkv": ("a_qs2x2a1.5.mkv", "b_qs2x2a1.5.mkv")}
        for name, (first, _) in self.films.items():
            shutil.copy(kept / first, self.folder / name)
        self.sources = [*self.films, "frames/%03d.ppm", "still.ppm", "list.toml", "card", "gone.lts"]
        (self.folder / "list.toml").write_text(
            'format = 1\nloop = "forever"\n' + "".join(
                f'[[item]]\nsource = "{name}"\nduration_s = 3.0\n'
                for name in [*self.films, "frames/%03d.ppm", "still.ppm", "gone.lts"]))

    @staticmethod
    def picture(width, height, level):
        row = bytes((level + 3 * x) % 256 for x in range(width * 3))
        return b"P6 %d %d 255\n" % (width, height) + row * height

    @classmethod
    def quilt(cls, frame):
        return cls.picture(96, 64, frame * 13)

    # --- what the owner does; each returns words for the log ---

    def tell(self, verb, **fields):
        Control(self.socket).tell(verb, **fields)
        return " ".join([verb, *map(str, fields.values())])

    def load(self):
        return self.tell("load", source=str(self.folder / self.random.choice(self.sources)))

    def interrupt(self):
        return self.tell("interrupt", source=str(self.folder / self.random.choice(self.sources)))

    def jump(self):
        return self.tell(self.random.choice(("next", "previous")))

    def seek(self):
        return self.tell("seek", frame=self.random.choice((0, 1, 7, 15, 23, 24, 500)))

    def speed(self):
        return self.tell("speed", factor=self.random.choice((0.25, 0.5, 1, 1, 2, 4, 8)))

    def trim(self):
        return self.tell("trim", offset_by=self.random.uniform(-0.02, 0.02))

    def blank(self):
        return self.tell(self.random.choice(("blank", "back", "back")))

    def pause(self):
        return self.tell(self.random.choice(("pause", "play", "play")))

    def power(self):
        return self.tell("power", to=self.random.choice(("off", "on", "on")))

    def a_film(self):
        name = self.random.choice(list(self.films))
        return self.folder / name, self.folder / "kept" / self.random.choice(self.films[name])

    def copy_over(self):
        film, new = self.a_film()
        film.touch()
        shutil.copyfile(new, film)
        return f"cp {new.name} {film.name}"

    def copy_slowly(self):
        film, new = self.a_film()
        data = new.read_bytes()
        with open(film, "r+b" if film.exists() else "w+b") as file:
            for part in range(4):
                file.write(data[part * len(data) // 4:(part + 1) * len(data) // 4])
                file.flush()
                time.sleep(0.3)
            file.truncate()
        return f"cp {new.name} {film.name}, slowly"

    def damage(self):
        film, _ = self.a_film()
        film.touch()
        how = self.random.choice(("emptied", "cut off", "noise"))
        size = film.stat().st_size
        if how == "emptied":
            os.truncate(film, 0)
        elif how == "cut off":
            os.truncate(film, size // 2)
        else:
            with open(film, "r+b") as file:
                file.seek(self.random.randrange(max(1, size)))
                file.write(self.random.randbytes(2000))
        return f"{film.name}: {how}"

    def rename(self):
        film, new = self.a_film()
        if film.exists() and self.random.random() < 0.5:
            film.rename(film.with_suffix(".away"))
            return f"mv {film.name} away"
        shutil.copyfile(new, self.folder / "arriving")
        (self.folder / "arriving").rename(film)
        return f"mv {new.name} {film.name}"

    def disk(self):
        if not self.may_mount:
            return "full disk: not tried, this user may not mount"
        filler = self.statistics / "filler"
        if filler.exists():
            filler.unlink()
            return "disk free"
        try:
            filler.write_bytes(bytes(1 << 20))
        except OSError:
            pass
        return "disk full"

    def children(self):
        return [int(pid) for pid in subprocess.run(
            ["pgrep", "-P", str(self.player.pid)], capture_output=True, text=True,
            check=False).stdout.split()]

    def decoder(self):
        what = self.random.choice((signal.SIGKILL, signal.SIGSTOP, signal.SIGSEGV))
        children = self.children()
        for child in children:
            try:
                os.kill(child, what)
            except ProcessLookupError:
                pass
        return f"{what.name} to {len(children)} decoders"

    def hang_up(self):
        self.player.send_signal(signal.SIGHUP)
        return "SIGHUP"

    def visit(self):
        if self.page is not None:
            self.page.kill()
            self.page.wait()
            self.page = None
            return "page closed"
        self.page = subprocess.Popen(
            [self.lenticule, "web", "--socket", str(self.socket), "--state",
             str(self.folder / "web"), "--media", str(self.folder), "--listen", "127.0.0.1:0"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return "page open"

    def act(self):
        actions = [self.copy_over, self.copy_slowly, self.damage, self.rename, self.decoder] * 2
        if self.controlled:
            actions += [self.load] * 4 + [
                self.interrupt, self.jump, self.jump, self.seek, self.seek, self.speed, self.speed,
                self.trim, self.blank, self.pause, self.power, self.disk, self.hang_up, self.visit]
        return self.random.choice(actions)()

    def status(self):
        """Returns a function that asks for the number of shown frames, the state and the problem."""
        if self.controlled:
            return lambda connection=Control(self.socket): connection.ask("status")

        def from_statistics():
            statistics = json.loads((self.statistics / "stats.json").read_text())
            return {"frames_shown": statistics["shown"], "state": statistics["outcome"],
                    "last_problem": statistics.get("playlist", {}).get("last_problem")}
        return from_statistics

    def close(self):
        for process in (self.page, self.player):
            if process is not None:
                process.kill()
                process.wait()
        if self.may_mount:
            subprocess.run(["umount", str(self.statistics)], check=False)


class Watch(threading.Thread):
    """Watch asks the player for its status ten times a second, and finds standstills without a word."""

    def __init__(self, stage):
        super().__init__(daemon=True)
        self.stage = stage
        self.over = threading.Event()
        self.faults = []
        self.longest = 0.0
        self.explained = 0

    def run(self):
        ask = self.stage.status()
        shown, since, asked, told = None, time.monotonic(), time.monotonic(), False
        while not self.over.wait(0.1):
            try:
                status = ask()
            except (OSError, ValueError) as error:
                if not self.over.is_set():
                    self.faults.append(f"no answer to status: {error}")
                return
            now = time.monotonic()
            late = now - asked > 1.0  # this process did not run: nothing is known of the panel
            asked = now
            moved = status["frames_shown"] != shown or status["state"] in EXPECTED_STILL
            if moved or late:
                shown, since, told = status["frames_shown"], now, False
                continue
            still = now - since
            problem = status.get("last_problem")
            line = self.stage.log.since(since - NOTICE)
            if still > STILL_LIMIT + NOTICE and not told:
                told = True
                if problem and line:
                    self.explained += 1
                else:
                    self.faults.append(
                        f"still for {still:.1f} s in state {status['state']}, "
                        f"problem {problem!r}, log {line}, status {json.dumps(status)}")
            if not (problem and line):
                self.longest = max(self.longest, still)


def wait_for_player(stage):
    end = time.monotonic() + ANSWER_LIMIT
    while True:
        try:
            return stage.status()()
        except (OSError, ValueError):
            if time.monotonic() > end or stage.player.poll() is not None:
                raise SystemExit("the player does not start: " + str(stage.log.since(0))) from None
            time.sleep(0.1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--lenticule", required=True)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6))
    parser.add_argument("--clock", choices=("real", "simulated"), default="real")
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="random-owner-"))
    stage = Stage(arguments, folder)
    done = []
    try:
        wait_for_player(stage)
        watch = Watch(stage)
        watch.start()
        begin = time.monotonic()
        end = begin + arguments.seconds
        stopped = threading.Event()
        signal.signal(signal.SIGINT, lambda *_: stopped.set())
        while time.monotonic() < end and not stopped.is_set() and stage.player.poll() is None and watch.is_alive():
            try:
                words = stage.act()
            except (ConnectionError, FileNotFoundError, socket.timeout) as error:
                words = f"failed: {error}"
            done.append(words)
            if arguments.verbose:
                print(f"{time.monotonic() - begin:8.1f} {words}", flush=True)
            time.sleep(stage.random.choice((0.05, 0.2, 0.5, 1.0, 3.0)))
        seconds = time.monotonic() - begin
        exit_code = stage.player.poll()
        watch.over.set()
        watch.join()
    finally:
        stage.close()
    faults = list(watch.faults)
    if exit_code is not None:
        faults.insert(0, f"the player ended with exit code {exit_code}")
    print(f"seed {arguments.seed}, {arguments.clock} clock, {seconds:.0f} s: {len(done)} actions, "
          f"longest standstill without a word {watch.longest:.1f} s, {watch.explained} named by status "
          f"and log, {len(faults)} faults")
    if not faults:
        shutil.rmtree(folder)
        return 0
    print(*faults, sep="\n")
    print("the last actions:", *done[-8:], sep="\n  ")
    print("the last lines of the log:", *stage.log.since(0)[-20:], sep="\n  ")
    return 1


if __name__ == "__main__":
    sys.exit(main())
