# SPDX-License-Identifier: Apache-2.0
"""Runs systemd in a guest, as first process of a namespace: the guest's own is the agent."""

import time

from vm import CommandFailed

# A starting systemd reads thousands of files, which takes a minute on a busy host.
ANSWER_SECONDS = 180

# Units of other packages at the start of a system. In the guest, which is set up already, they would
# take most of the time; nothing here depends on them. Events of devices are triggered by subsystem.
MASKED = ["kmod-static-nodes", "systemd-binfmt", "systemd-machine-id-commit", "systemd-modules-load",
          "systemd-pstore", "systemd-random-seed", "systemd-remount-fs", "systemd-sysctl",
          "systemd-sysusers", "systemd-tmpfiles-setup", "systemd-tmpfiles-setup-dev",
          "systemd-udev-trigger", "systemd-update-utmp"]
# A folder without generators, which would read the configuration of this host at each reload.
NO_GENERATORS = "SYSTEMD_GENERATOR_PATH=/run/no-generators"
DEVICES = ["drm", "graphics", "video4linux"]


class Systemd:
    """Runs until the guest's processes are ended. Sees the guest's files and devices."""

    def __init__(self, vm):
        self.vm = vm
        vm.check("mkdir -p /sys/fs/cgroup && mount -t cgroup2 none /sys/fs/cgroup")
        vm.check(f"mkdir -p /run/systemd/system /run/no-generators && cd /run/systemd/system && "
                 f"for unit in {' '.join(MASKED)}; do ln -s /dev/null $unit.service; done")
        self.process = vm.start(["unshare", "--fork", "--pid", "--mount", "--mount-proc",
                                 "env", "container=test", NO_GENERATORS,
                                 "/lib/systemd/systemd", "--system",
                                 "--unit=sysinit.target", "--show-status=no"])
        vm.wait_for_path("/run/systemd/private", ANSWER_SECONDS)
        matches = " ".join(f"--subsystem-match={name}" for name in DEVICES)
        # Waits for the end of the job that runs.
        self.check("sh -c 'systemctl start sysinit.target && "
                   f"udevadm trigger --action=add {matches} && udevadm settle --timeout=60'")

    def run(self, command, timeout=ANSWER_SECONDS):
        """Runs a shell command in the namespace, outside of which systemctl does not work."""
        outside = self.process.pid
        return self.vm.run(f"pid=$(cat /proc/{outside}/task/{outside}/children) && "
                           f"exec nsenter --target $pid --pid --mount {command}", timeout)

    def check(self, command, timeout=ANSWER_SECONDS):
        result = self.run(command, timeout)
        if result.code != 0:
            raise CommandFailed(f"'{command}': {result}\n{self.process.stderr[-2000:]}")
        return result.stdout

    def systemctl(self, *words):
        return self.run(" ".join(["systemctl", *words]))


class Unit:
    """One unit of this systemd."""

    def __init__(self, systemd, name):
        self.systemd = systemd
        self.name = name

    def check(self, *words):
        """Runs systemctl WORDS UNIT, which must succeed; returns its output."""
        result = self.systemd.systemctl(*words, self.name)
        assert result.code == 0, (result, self.journal())
        return result.stdout

    def facts(self, *names):
        shown = self.check("show", *(f"-p{name}" for name in names))
        return dict(line.split("=", 1) for line in shown.splitlines())

    def wait_until(self, wanted, timeout=120):
        """Waits until wanted(facts) holds; returns those facts."""
        deadline = time.monotonic() + timeout
        while True:
            now = self.facts("ActiveState", "SubState", "MainPID", "StatusText", "Result",
                             "NRestarts")
            if wanted(now):
                return now
            assert time.monotonic() < deadline, (now, self.journal())
            time.sleep(1)  # a question takes the guest about as long

    def wait_for_main_process(self, other_than=None, timeout=120):
        """Waits until the unit is active; returns its main process's id, as systemd counts."""
        return self.wait_until(lambda now: now["ActiveState"] == "active"
                               and now["MainPID"] not in ("0", other_than), timeout)["MainPID"]

    def journal(self):
        return (self.systemd.systemctl("status", "--no-pager", "--lines=40", self.name).stdout
                + self.systemd.process.stderr[-2000:])
