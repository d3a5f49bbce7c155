# SPDX-License-Identifier: Apache-2.0
"""Tests the Debian packages: made by cpack, installed by dpkg, then a kiosk as in docs/play/kiosk.md."""

import json
import pathlib
import subprocess
import time

import picture
from content import Content
from guest_systemd import Systemd, Unit
from vm_test import Machine, Skip, require_program, vm_test

SOURCE = pathlib.Path(__file__).resolve().parents[2]
# Small, since the guest renders its own frames.
MACHINE = Machine(display="virtio-gpu", width=320, height=240)
FRAMES = 3
# No triggers of other packages: one of them would index all manual pages of this host.
DPKG = "dpkg --no-triggers --force-unsafe-io"
STATS = "/run/lenticule/lobby/stats.json"
# Shorter than the 30 s after which the player probes its panel without an event.
HEARD_SECONDS = 25


KIOSK = ["lenticule-player", "lenticule-media"]


def make_packages(vm):
    """Makes cpack's .deb files in a folder that the guest sees."""
    for program in ["lenticule", "lenticule-tools", "lenticule-video"]:
        require_program(vm, program)
    for made in ["CPackConfig.cmake", "generated/lenticule.1", "include/liblenticule.so"]:
        if not (vm.build / made).exists():
            raise Skip(f"{made} is not in {vm.build}: the package needs the whole tree built")
    folder = vm.exchange / "package"
    done = subprocess.run(["cpack", "-G", "DEB", "--config", vm.build / "CPackConfig.cmake",
                           "-B", folder], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done
    assert len(list(folder.glob("*.deb"))) >= 5, list(folder.iterdir())


def install(systemd, *names):
    files = " ".join(f"/exchange/package/{name}_*.deb" for name in names)
    systemd.check(f"sh -c '{DPKG} --install {files}'", 300)
    for name in names:
        assert systemd.check(f"dpkg --verify {name}") == ""


def check_files(systemd):
    """Checks that user, folders and rules are in force."""
    assert systemd.check("id -Gn lenticule").split() == ["lenticule", "video"]
    folders = systemd.check("stat -c '%n %U:%G %a' /etc/lenticule /var/lib/lenticule "
                            "/var/lib/lenticule/rigs")
    assert folders.splitlines() == ["/etc/lenticule root:root 755",
                                    "/var/lib/lenticule lenticule:lenticule 750",
                                    "/var/lib/lenticule/rigs lenticule:lenticule 750"], folders
    rules = systemd.run("udevadm test /sys/class/drm/card0")
    assert "/lib/udev/rules.d/70-lenticule.rules" in rules.stderr, rules
    assert systemd.check("stat -c '%G %a' /dev/dri/card0") == "video 660\n"
    units = "lenticule-player@lobby.service lenticule-renderer@lobby.service"
    verified = systemd.run(f"systemd-analyze verify {units}", 120)
    complaints = [line for line in verified.stderr.splitlines() if "lenticule" in line]
    assert verified.code == 0 and complaints == [], verified


def check_program(vm, systemd):
    """Checks that the installed program runs, and names the package of what it lacks."""
    systemd.check(f"mount -t tmpfs none {vm.build}/modules")  # nothing to be found there any more
    assert systemd.check("which lenticule") == "/usr/bin/lenticule\n"
    assert systemd.check("lenticule --version").startswith("lenticule ")
    missing = systemd.run("lenticule render builtin:demo")
    assert missing.code == 1 and "install the package lenticule\n" in missing.stderr, missing


def check_tools(systemd):
    """Checks that the installed renderer's program runs, including its library for pictures."""
    crate = SOURCE / "tests" / "data" / "crate.png"
    systemd.check(f"lenticule compare {crate} {crate}")


def wait_for_frames(vm, content):
    """Waits until every frame of the sequence was on the screen, and no other picture."""
    frames = {frame.rgb: number for number, frame in enumerate(content.frames())}
    console = vm.screendump()
    seen = set()
    deadline = time.monotonic() + 240
    while len(seen) < FRAMES:
        screen = vm.screendump()
        number = frames.get(screen.rgb)
        assert number is not None or (screen == console and not seen) or is_black(screen), seen
        seen |= {number} - {None}
        assert time.monotonic() < deadline, seen
        time.sleep(0.1)


def is_black(screen):
    return not any(screen.rgb)


def stats(vm):
    return json.loads(vm.read_file(STATS))


def plug(vm, status, wanted):
    """Simulates unplugging or plugging the cable; the service must receive the event."""
    vm.write_file("/sys/class/drm/card0-Virtual-1/status", status)
    vm.write_file("/sys/class/drm/card0/uevent", "change")
    deadline = time.monotonic() + HEARD_SECONDS
    while stats(vm)["kms"]["panel"] != wanted:
        assert time.monotonic() < deadline, stats(vm)["kms"]
        time.sleep(0.2)


def upgrade(vm, systemd, player, content):
    """Installs a new player, which takes over the picture, and a new renderer for its ring."""
    before = player.wait_for_main_process()
    install(systemd, *KIOSK, "lenticule")
    player.wait_for_main_process(other_than=before)
    wait_for_frames(vm, content)
    assert stats(vm)["kms"]["took_over"], stats(vm)["kms"]


@vm_test(MACHINE, fresh=True)
def sets_up_a_kiosk(vm):
    make_packages(vm)
    content = Content(vm, MACHINE.width, MACHINE.height, FRAMES)
    systemd = Systemd(vm)
    console = vm.screendump()
    install(systemd, *KIOSK)
    check_files(systemd)
    check_program(vm, systemd)
    install(systemd, "lenticule")
    check_tools(systemd)

    vm.check(["cp", content.rig, "/etc/lenticule/lobby.toml"])
    vm.write_file("/etc/lenticule/lobby.conf",
                  f"SCENE=builtin:demo:2\nFRAMES=0:{FRAMES}\nOPTIONS=--fps 1\n")
    player = Unit(systemd, "lenticule-player@lobby.service")
    renderer = Unit(systemd, "lenticule-renderer@lobby.service")
    systemd.check(f"systemctl enable --now {player.name} {renderer.name}", 300)
    wait_for_frames(vm, content)
    done = renderer.wait_until(lambda now: now["ActiveState"] == "inactive")
    assert done["Result"] == "success", (done, renderer.journal())
    now = player.facts("ActiveState", "User", "NRestarts")
    assert now == {"ActiveState": "active", "User": "lenticule", "NRestarts": "0"}, now

    for _ in range(2):
        plug(vm, "off", "disconnected")
        plug(vm, "on", "showing")
        wait_for_frames(vm, content)
    assert stats(vm)["kms"]["hotplugs"] >= 4, stats(vm)["kms"]
    upgrade(vm, systemd, player, content)

    systemd.check(f"{DPKG} --remove lenticule {' '.join(KIOSK)}", 120)
    assert systemd.systemctl("is-active", player.name).stdout == "inactive\n"  # and not "failed"
    vm.wait_for_screen(console)
    picture.assert_same(vm.screendump(), console)
