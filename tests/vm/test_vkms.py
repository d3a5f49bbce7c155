# SPDX-License-Identifier: Apache-2.0
"""Tests outputs of vkms that only newer kernels can make: several connectors with vblanks of their own,
and planes with colour pipelines. They are made through configfs (Documentation/gpu/vkms.rst)."""

import signal
import subprocess

import guest_files
import picture
import vkms
from content import Content
from playing import STATS, play, play_command, stats, wait_until_shown
from test_walls import FRAMES, PANELS, SIZE, make_wall, play_wall
from vm_test import Machine, Skip, require_program, vm_test

SINCE = (6, 19)
OLDEST_LIBDRM = "2.4.125"  # the first that finds cards on the bus "faux", where newer vkms is
PLANES = Machine(modules=("vkms enable_overlay=1 enable_plane_pipeline=1",))
CONFIGURED = Machine(modules=("vkms create_default_dev=0",))
OVERLAY, PRIMARY, CONNECTED = 0, 1, 1
FOLDER = "/sys/kernel/config/vkms/two"


def require_libdrm():
    version = guest_files.package_version("libdrm2")
    if subprocess.run(["dpkg", "--compare-versions", version, "lt", OLDEST_LIBDRM]).returncode == 0:
        raise Skip(f"libdrm {version} does not find newer vkms: {OLDEST_LIBDRM} is needed (Debian 14)")


def make_two_outputs(vm):
    """Makes a card with two CRTCs, each with a connector, a primary plane and an overlay."""
    require_libdrm()
    if vm.run(["test", "-e", FOLDER]).code == 0:
        return
    vm.run("mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config")
    commands = [f"mkdir {FOLDER}", f"cd {FOLDER}"]
    for n in (1, 2):
        commands += [f"mkdir crtcs/{n} encoders/{n} connectors/{n} planes/primary{n} planes/overlay{n}",
                     f"echo {PRIMARY} > planes/primary{n}/type", f"echo {OVERLAY} > planes/overlay{n}/type",
                     f"echo {CONNECTED} > connectors/{n}/status",
                     f"ln -s {FOLDER}/encoders/{n} connectors/{n}/possible_encoders/"]
        commands += [f"ln -s {FOLDER}/crtcs/{n} {user}{n}/possible_crtcs/"
                     for user in ("encoders/", "planes/primary", "planes/overlay")]
    vm.check(" && ".join([*commands, "echo 1 > enabled"]))
    vm.card("vkms")


def check_crtc(vm, number, shown):
    """Checks the next picture that a CRTC composes, by its checksum."""
    folder = f"/sys/kernel/debug/dri/{vm.card('vkms')}/crtc-{number}/crc"
    vm.write_file(f"{folder}/control", "auto")
    composed = vkms.parse_crcs(vm.check(f"head -n 1 {folder}/data", 60).stdout)
    assert [frame.crc for frame in composed] == [vkms.expected_crc(shown)], (number, composed)


def check_end(player):
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr


@vm_test(CONFIGURED, since=SINCE)
def each_connector_shows_its_panel_of_a_wall(vm):
    make_two_outputs(vm)
    folder = make_wall(vm)
    player = play_wall(vm, "--frames", "1:2", "--loop", "forever")
    done = wait_until_shown(vm, player)
    assert done["exactness"]["exact"] == "yes" and done["clock"] == "hardware", done
    for number, panel in enumerate(PANELS):
        check_crtc(vm, number, picture.read(folder / f"00001-{panel}.png"))
    check_end(player)


@vm_test(CONFIGURED, since=SINCE)
def connectors_with_vblanks_of_their_own_flip_in_one_commit(vm):
    make_two_outputs(vm)
    make_wall(vm)
    result = play_wall(vm, "--fps", "3", "--loop", "6").wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == 6 * FRAMES, done
    kms = done["kms"]
    assert kms["flips"] == 6 * FRAMES and kms["one_commit"], kms
    assert kms["flip_timeouts"] == 0 and kms["stray_events"] == 0, kms
    print(f"largest difference of two connectors: {kms['largest_skew_us']:.0f} us")


@vm_test(CONFIGURED, since=SINCE)
def a_panel_is_found_by_its_connector_among_several(vm):
    make_two_outputs(vm)
    content = Content(vm, *SIZE, 2)
    refused = play(vm, content, "--duration", "2").wait(60)
    assert refused.code == 3 and "Virtual-1" in refused.stderr and "Virtual-2" in refused.stderr, refused
    command = play_command(vm, content, "--frames", "1:2", "--loop", "forever")
    vm.run(["rm", "-f", STATS])
    player = vm.start(["kms:Virtual-2" if word == "kms" else word for word in command])
    wait_until_shown(vm, player)
    check_crtc(vm, 1, content.frame(1))
    check_end(player)


def planes_in_use(vm):
    return vm.check(f"cat /sys/kernel/debug/dri/{vm.card('vkms')}/state").stdout.count("crtc=crtc-0")


@vm_test(PLANES, since=SINCE)
def overlay_and_colour_pipeline_of_another_program_are_removed(vm):
    require_libdrm()
    content = Content(vm, *SIZE, 2)
    other = vm.start([require_program(vm, "vm_other_client"), f"/dev/dri/card{vm.card('vkms')}"])
    other.wait_for_line("left", 60)
    before = planes_in_use(vm)
    player = play(vm, content, "--frames", "1:2", "--loop", "forever")
    done = wait_until_shown(vm, player)
    assert done["exactness"]["exact"] == "yes", done["exactness"]
    assert "plane 'COLOR_PIPELINE' is Bypass" in done["exactness"]["proved"], done["exactness"]
    check_crtc(vm, 0, content.frame(1))
    assert planes_in_use(vm) == before - 1
    check_end(player)
