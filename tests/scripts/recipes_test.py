# SPDX-License-Identifier: Apache-2.0
"""Tests the files of docs/recipes.md: recipes_test.py LENTICULE

Opening hours are checked over a simulated year in several time zones, with the program that systemd
itself uses for calendars."""

import datetime
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zoneinfo

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "examples"
HOURS = EXAMPLES / "opening-hours"
YEAR = 2027
OPENS = {day: datetime.time(8, 30) for day in range(5)} | {5: datetime.time(10), 6: datetime.time(10)}
CLOSES = {day: datetime.time(19) for day in range(5)} | {5: datetime.time(18), 6: datetime.time(18)}
ZONES = ("Europe/Berlin", "America/New_York", "Australia/Lord_Howe", "UTC")


def elapses(timer, zone):
    """Returns the times of a year at which a timer elapses, sorted, in seconds since 1970."""
    seconds = set()
    for line in (HOURS / timer).read_text().splitlines():
        if not line.startswith("OnCalendar="):
            continue
        calendar = line.partition("=")[2]
        text = subprocess.run(
            ["systemd-analyze", "calendar", f"--base-time={YEAR}-01-01 00:00:00",
             "--iterations=400", calendar],
            env=dict(os.environ, TZ=zone), capture_output=True, text=True, check=True).stdout
        # The zone UTC has no second line "(in UTC)".
        pattern = (r"\(in UTC\): \w+ (\S+ \S+) UTC" if zone != "UTC"
                   else r"(?:Next elapse|Iter\. #\d+|Iteration #\d+): \w+ (\S+ \S+) UTC")
        for found in re.findall(pattern, text):
            time = datetime.datetime.strptime(found, "%Y-%m-%d %H:%M:%S")
            seconds.add(time.replace(tzinfo=datetime.timezone.utc).timestamp())
    end = datetime.datetime(YEAR + 1, 1, 1, tzinfo=zoneinfo.ZoneInfo(zone)).timestamp()
    return sorted(second for second in seconds if second < end)


def local(second, zone):
    return datetime.datetime.fromtimestamp(second, zoneinfo.ZoneInfo(zone))


class OpeningHours(unittest.TestCase):
    def test_every_day_of_the_year_opens_and_closes_at_its_local_time(self):
        for zone in ZONES:
            for timer, times in (("lenticule-open@.timer", OPENS),
                                 ("lenticule-close@.timer", CLOSES)):
                with self.subTest(zone=zone, timer=timer):
                    seen = [local(second, zone) for second in elapses(timer, zone)]
                    self.assertEqual(len({moment.date() for moment in seen}), 365)
                    self.assertEqual(len(seen), 365)
                    for moment in seen:
                        self.assertEqual(moment.time(), times[moment.weekday()], moment)

    def test_the_year_has_changes_of_the_clock(self):
        offsets = {local(second, "Europe/Berlin").utcoffset()
                   for second in elapses("lenticule-open@.timer", "Europe/Berlin")}
        self.assertEqual(len(offsets), 2)

    def test_openings_and_closings_alternate(self):
        for zone in ZONES:
            events = sorted([(second, "open") for second in elapses("lenticule-open@.timer", zone)] +
                            [(second, "close") for second in elapses("lenticule-close@.timer", zone)])
            for before, after in zip(events, events[1:]):
                self.assertNotEqual(before[1], after[1], (zone, after))


class WithStandIns(unittest.TestCase):
    """Has a folder of stand-ins for other programs."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def stand_in(self, name, script):
        file = self.folder / name
        file.write_text("#!/bin/sh\n" + script)
        file.chmod(0o755)
        return file

    def run_script(self, file, *words, **variables):
        path = f"{self.folder}:{file.parent}:{os.environ['PATH']}"
        return subprocess.run([file, *words], env=dict(os.environ, PATH=path, **variables),
                              capture_output=True, text=True, stdin=subprocess.DEVNULL)


class Units(WithStandIns):

    def test_systemd_accepts_the_units(self):
        program = self.stand_in("lenticule", "exit 0\n")
        for unit in HOURS.glob("lenticule-*@.*"):
            text = unit.read_text().replace("/usr/bin/lenticule", str(program))
            text = text.replace("/usr/local/bin/lenticule-hours", str(program))
            (self.folder / unit.name).write_text(text)
        for kind in ("open@lobby.timer", "close@lobby.timer", "open@lobby.service",
                     "close@lobby.service", "hours@lobby.service"):
            result = subprocess.run(
                ["systemd-analyze", "verify", "--man=no", str(self.folder / f"lenticule-{kind}")],
                capture_output=True, text=True, env=dict(os.environ, SYSTEMD_UNIT_PATH=f"{self.folder}:"))
            self.assertEqual((result.returncode, result.stderr), (0, ""), kind)

    def test_the_services_call_a_verb_that_exists(self):
        for unit in HOURS.glob("lenticule-*@.service"):
            [command] = re.findall(r"^ExecStart=(.*)$", unit.read_text(), re.MULTILINE)
            if "lenticule-hours" in command:
                continue
            words = command.replace("%i", "no-such-panel").split()
            result = subprocess.run([LENTICULE, *words[1:]], capture_output=True, text=True)
            self.assertEqual(result.returncode, 3, result.stderr)  # no player, not: no such verb

    def test_after_a_boot_the_next_timer_decides(self):
        self.stand_in("systemctl", 'case "$*" in *open@lobby*) echo @$OPEN;; *) echo @$CLOSE;; esac\n')
        self.stand_in("lenticule", 'echo "$@"\n')
        for opens, closes, power in ((100, 200, "off"), (300, 200, "on")):
            result = self.run_script(HOURS / "lenticule-hours", "lobby", OPEN=str(opens),
                                     CLOSE=str(closes))
            self.assertEqual(
                result.stdout,
                f"ctl --socket /run/lenticule/lobby/control.sock power {power}\n", result.stderr)


class Remote(WithStandIns):
    """The other programs print what they print on Debian 12."""

    def setUp(self):
        super().setUp()
        self.stand_in("lenticule", f'echo "$@" >> {self.folder}/done\n')

    def done(self):
        file = self.folder / "done"
        prefix = "ctl --socket /c.sock "
        lines = file.read_text().splitlines() if file.exists() else []
        self.assertTrue(all(line.startswith(prefix) for line in lines), lines)
        return [line.removeprefix(prefix) for line in lines]

    def test_only_listed_words_are_done(self):
        self.stand_in("mosquitto_sub", "printf '%s\\n' 'go' 'power off' 'quit' 'speed 0.5' "
                      "'load /etc/shadow' 'go; reboot' 'power on now' '' 'speed 99'\n")
        result = self.run_script(EXAMPLES / "remote" / "lenticule-mqtt", "/c.sock", "broker", "topic")
        self.assertEqual(self.done(), ["go", "power off", "speed 0.5"])
        self.assertEqual(result.stderr.count("ignored: "), 6, result.stderr)

    def test_each_press_of_a_button_is_a_go(self):
        self.stand_in("gpiomon", 'test "$5 $6" = "gpiochip0 17" || exit 1\necho go\necho go\n')
        self.run_script(EXAMPLES / "remote" / "lenticule-button", "/c.sock", "gpiochip0", "17")
        self.assertEqual(self.done(), ["go", "go"])

    def test_osc_addresses_are_verbs(self):
        self.stand_in("oscdump", "echo 'eeb13ca9.6e2af576 /lenticule/go '\n"
                      "echo 'eeb13ca9.6e2af576 /mixer/go '\n"
                      "echo 'eeb13ca9.716fc9bc /lenticule/power/off i 1'\n")
        self.run_script(EXAMPLES / "remote" / "lenticule-osc", "/c.sock", "7770")
        self.assertEqual(self.done(), ["go", "power off"])

    def follow_the_output(self, television):
        """Runs lenticule-cec while the output goes off and on; returns the messages and the report."""
        self.stand_in("sleep", "")
        self.stand_in("cec-ctl", f'echo "$@" >> {self.folder}/cec\ncase "$*" in *power-status) {television} ;; esac\n')
        self.stand_in("lenticule", """printf '%s\\n' '{"event":"state","state":"off"}' \\
  '{"event":"item_started","source":"a.lts"}' '{"event":"state","state":"playing"}'\n""")
        result = self.run_script(EXAMPLES / "remote" / "lenticule-cec", "/c.sock", "/dev/cec0")
        sent = (self.folder / "cec").read_text().replace("--device /dev/cec0 ", "").splitlines()
        return sent, result.stderr.splitlines()

    def test_a_television_follows_the_output(self):
        sent, report = self.follow_the_output(
            f"grep -q image-view-on {self.folder}/cec && echo 'pwr-state: to-on (0x02)'"
            " || echo 'pwr-state: standby (0x01)'")
        status = "--to 0 --give-device-power-status"
        self.assertEqual(sent, ["--playback", "--to 0 --standby", status, "--to 0 --image-view-on", status])
        self.assertEqual(report, ["television: standby", "television: to-on"])

    def test_a_television_that_does_not_follow_is_asked_twice_and_reported(self):
        sent, report = self.follow_the_output("echo 'pwr-state: on (0x00)'")
        self.assertEqual(sent.count("--to 0 --standby"), 2)
        self.assertEqual(report, ["television: asked twice for standby, it says on", "television: on"])
        (self.folder / "cec").unlink()
        _, report = self.follow_the_output("echo 'Transmitted, NACK'")
        self.assertEqual(report[0], "television: asked twice for standby, it says nothing")


if __name__ == "__main__":
    LENTICULE = sys.argv.pop(1)
    unittest.main()
