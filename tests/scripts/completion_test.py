#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Asks bash, zsh and fish to complete command lines by the scripts of `lenticule completion`:
completion_test.py LENTICULE"""

import os
import pathlib
import pty
import re
import select
import subprocess
import sys
import tempfile
import time
import unittest

SECONDS = 60

# In place of lenticule: prints its arguments, so that a test sees the line that the shell has completed.
PROGRAM = """#!/bin/sh
for last; do :; done
if [ "$last" = --help ]; then exec {lenticule} "$@"; fi
printf 'ran<%s>\\n' "$*"
"""

# The words before, the word that is typed, and what Tab makes of it.
LINES = [
    ("", "rend", "render"),
    ("render", "a_fi", "a_film.lts"),
    ("render", "--metho", "--method"),
    ("render builtin:demo --method", "ad", "adaptive"),
    ("render builtin:demo --tone-map", "ac", "aces"),
    ("render builtin:demo -o", "a_fi", "a_film.lts"),
    ("render builtin:demo --method adaptive", "--psn", "--psnr"),
    ("play a_film.lts --rig", "a_ri", "a_rig.toml"),
    ("play a_film.lts --loop", "fore", "forever"),
    ("play a_film.lts --display", "virt", "virtual"),
    ("play a_film.lts --late", "dr", "drop"),
    ("ctl", "interr", "interrupt"),
    ("ctl --json power", "of", "off"),
    ("ctl --socket x snapshot", "a_fi", "a_film.lts"),
    ("ctl speed 2", "--wai", "--wait"),
    ("calibrate", "by-e", "by-eye"),
    ("calibrate by-eye", "--insi", "--insist"),
    ("farm plan", "--chun", "--chunk"),
    ("completion", "fi", "fish"),
    ("web", "addr", "address"),
    ("web", "--media-l", "--media-limit"),
    ("web --state", "a_fi", "a_film.lts"),
    ("bench", "stabi", "stability"),
    ("bench weave", "--ri", "--rig"),
]


class Terminal:
    """A program on a pseudo-terminal."""

    def __init__(self, arguments, folder, environment):
        self.process, self.fd = pty.fork()
        if self.process == 0:
            os.chdir(folder)
            os.execvpe(arguments[0], arguments, environment)
        self.seen = ""

    def type(self, text):
        os.write(self.fd, text.encode())

    def read_until(self, pattern):
        """Returns the match of the pattern, and forgets what was printed before its end."""
        until = time.monotonic() + SECONDS
        while not (match := re.search(pattern, self.seen)):
            if not select.select([self.fd], [], [], max(0.0, until - time.monotonic()))[0]:
                raise AssertionError(f"no {pattern} in {self.seen!r}")
            self.seen += os.read(self.fd, 4096).decode(errors="replace")
        self.seen = self.seen[match.end():]
        return match

    def close(self):
        os.kill(self.process, 9)
        os.waitpid(self.process, 0)
        os.close(self.fd)


class Completion(unittest.TestCase):
    lenticule = None

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.environment = {"HOME": str(cls.folder), "TERM": "dumb", "LANG": "C.UTF-8",
                           "PATH": f"{cls.folder}/bin:{os.environ['PATH']}"}
        (cls.folder / "bin").mkdir()
        program = cls.folder / "bin" / "lenticule"
        program.write_text(PROGRAM.format(lenticule=cls.lenticule))
        program.chmod(0o755)
        (cls.folder / "a_film.lts").touch()
        (cls.folder / "a_rig.toml").touch()
        for shell, name in (("bash", "lenticule.bash"), ("zsh", "_lenticule"), ("fish", "lenticule.fish")):
            script = subprocess.run([cls.lenticule, "completion", shell], stdout=subprocess.PIPE, check=True).stdout
            (cls.folder / name).write_bytes(script)

    def type_lines(self, shell, start):
        terminal = Terminal(shell, self.folder, self.environment)
        self.addCleanup(terminal.close)
        terminal.type(start + "; echo rea''dy\n")
        terminal.read_until("ready")
        for before, typed, expected in LINES:
            terminal.type(f"lenticule {before} {typed}\t\n")
            self.assertEqual(terminal.read_until("ran<(.*)>")[1].strip(), f"{before} {expected}".strip())

    def test_bash_completes_commands_flags_values_and_files(self):
        self.type_lines(["bash", "--norc", "--noprofile", "-i"], ". ./lenticule.bash")

    def test_bash_completes_a_value_behind_an_equals_sign(self):
        terminal = Terminal(["bash", "--norc", "--noprofile", "-i"], self.folder, self.environment)
        self.addCleanup(terminal.close)
        terminal.type(". ./lenticule.bash; echo rea''dy\n")
        terminal.read_until("ready")
        terminal.type("lenticule render --method=ad\t\n")
        self.assertEqual(terminal.read_until("ran<(.*)>")[1].strip(), "render --method=adaptive")

    def test_zsh_completes_commands_flags_values_and_files(self):
        self.type_lines(["zsh", "-f", "-i"], "fpath=($PWD $fpath); autoload -U compinit; compinit -u -D")

    def test_fish_completes_commands_flags_values_and_files(self):
        for before, typed, expected in LINES:
            with self.subTest(before=before, typed=typed):
                script = f". ./lenticule.fish; complete -C 'lenticule {before} {typed}'"
                rows = subprocess.run(["fish", "--no-config", "-c", script], cwd=self.folder, env=self.environment,
                                      stdout=subprocess.PIPE, text=True, check=True, timeout=SECONDS).stdout
                self.assertEqual([row.split("\t")[0] for row in rows.splitlines()], [expected])


if __name__ == "__main__":
    Completion.lenticule = os.path.abspath(sys.argv.pop(1))
    unittest.main()
