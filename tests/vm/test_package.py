# SPDX-License-Identifier: Apache-2.0
"""Tests the Debian packages: made by cpack, installed by dpkg, then a kiosk as in docs/play/kiosk.md."""

import json
import pathlib
import re
import shutil
import subprocess
import time

import picture
from content import Content
from guest_systemd import Systemd, Unit
from vm_test import Machine, Skip, require_program, vm_test

SOURCE = pathlib.Path(__file__).resolve().parents[2]
# Tiny, since the guest renders its own frames, and a ray takes an emulated processor hundreds of times as
# long. Other sizes give a mode whose sync pulses are 0 lines high, which the kernel refuses.
MACHINE = Machine(display="virtio-gpu", width=64, height=200, processors=1)
FRAMES = 3
# No triggers of other packages: one of them would index all manual pages of this host.
DPKG = "dpkg --no-triggers --force-unsafe-io"
DATABASE = pathlib.Path("/var/lib/dpkg")
STATS = "/run/lenticule/lobby/stats.json"
# Shorter than the 30 s after which the player probes its panel without an event.
HEARD_SECONDS = 25


KIOSK = ["lenticule-player", "lenticule-media"]


def make_packages(vm):
    """Makes the .deb files in a folder that the guest sees, as cpack does; returns their paths.
    scripts/check-package checks those of the other components, and the compressed ones."""
    for program in ["lenticule", "lenticule-tools", "lenticule-video", "lenticule-pictures"]:
        require_program(vm, program)
    for made in ["CPackConfig.cmake", "generated/lenticule.1", "include/liblenticule.so"]:
        if not (vm.build / made).exists():
            raise Skip(f"{made} is not in {vm.build}: the package needs the whole tree built")
    folder = vm.exchange / "package"
    done = subprocess.run(["cpack", "-G", "DEB", "--config", vm.build / "CPackConfig.cmake",
                           "-D", "CPACK_COMPONENTS_ALL=player;media;tools",
                           "-D", "CPACK_DEBIAN_COMPRESSION_TYPE=none",
                           "-B", folder], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done
    return list(folder.glob("*.deb"))


def stanzas_of_status():
    """Returns the fields of each package that dpkg knows on this host, with their text, by name."""
    found = {}
    for text in (DATABASE / "status").read_text().rstrip().split("\n\n"):
        fields = dict(re.findall(r"^([\w-]+): *(.*)$", text, re.MULTILINE))
        found[fields["Package"]] = (fields, text)
    return found


def names_in(dependencies):
    return [re.split(r"[ :(]", part.strip(), maxsplit=1)[0]
            for part in re.split(r"[,|]", dependencies) if part.strip()]


def needed_packages(packages, archives):
    """Returns the names of the installed packages that the archives depend on, directly or not."""
    providers = {}
    for name, (fields, _) in packages.items():
        for provided in [name, *names_in(fields.get("Provides", ""))]:
            providers.setdefault(provided, []).append(name)
    fields = subprocess.run(["sh", "-c", 'for f in "$@"; do dpkg-deb -f "$f" Depends; echo ,; done', "sh",
                             *archives], check=True, capture_output=True, text=True, timeout=60)
    open_names, needed = names_in(fields.stdout), set()
    while open_names:
        for name in providers.get(open_names.pop(), []):
            if name not in needed:
                needed.add(name)
                open_names += [other for kind in ("Depends", "Pre-Depends")
                               for other in names_in(packages[name][0].get(kind, ""))]
    return needed


def reduce_database(vm, archives):
    """Leaves dpkg only the packages that lenticule depends on: it reads the files' names of all packages
    each time. scripts/check-package installs beside all packages of this host."""
    packages = stanzas_of_status()
    needed = needed_packages(packages, archives)
    folder = vm.exchange / "dpkg"
    for name in ("info", "updates", "triggers"):
        (folder / name).mkdir(parents=True)
    (folder / "status").write_text("".join(f"{packages[name][1]}\n\n" for name in sorted(needed)))
    (folder / "info" / "format").write_text("1\n")
    for name in needed:
        for listing in (DATABASE / "info").glob(f"{name}[.:]*list"):
            shutil.copy(listing, folder / "info")
    vm.check(f"mount -t tmpfs none {DATABASE} && cp -r /exchange/dpkg/. {DATABASE}")


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


# scripts/check-package installs, upgrades and removes the packages with less, and test_units.py runs the units.
@vm_test(MACHINE, fresh=True, slow=True)
def sets_up_a_kiosk(vm):
    reduce_database(vm, make_packages(vm))
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
    systemd.check(f"systemctl enable --now {player.name} {renderer.name}", 600)
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
