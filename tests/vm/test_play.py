# SPDX-License-Identifier: Apache-2.0
"""lenticule play on the kernel's drivers: what was woven is what is scanned out, frame by frame."""

import json
import pathlib
import signal
import time

import picture
import vkms
from content import Content
from vm_test import Machine, require_program, vm_test

HERE = pathlib.Path(__file__).resolve().parent


def play_command(vm, content, *flags):
    return [require_program(vm, "lenticule"), "play", content.pattern(), "--rig", content.rig,
            "--display", "kms", "--stats", "/tmp/stats.json", *flags]


def play(vm, content, *flags, **options):
    """A running player."""
    vm.run(["rm", "-f", "/tmp/stats.json"])
    return vm.start(play_command(vm, content, *flags), **options)


def stats(vm):
    return json.loads(vm.read_file("/tmp/stats.json"))


def wait_until_shown(vm, player, count=1, timeout=60):
    """Waits until the player says that it has shown so many frames; returns its statistics."""
    deadline = time.monotonic() + timeout
    while True:
        running = player.running()
        if vm.run(["test", "-e", "/tmp/stats.json"]).code == 0:
            now = stats(vm)
            if now.get("shown", 0) >= count:
                return now
        assert running and time.monotonic() < deadline, (player.stdout, player.stderr)
        time.sleep(0.2)


def check_held_frame(vm, content, number):
    """Frame `number` alone, again and again: QEMU sees exactly it."""
    player = play(vm, content, "--frames", f"{number}:{number + 1}", "--loop", "forever")
    shown = wait_until_shown(vm, player)
    vm.wait_for_screen(content.frame(number))
    other = content.frame(number).with_pixel(3, 5, (1, 2, 3))
    assert picture.differing_pixels(vm.screendump(), other) == 1
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr
    return shown


def check_sequence(vm, content):
    """Every dump while a slow sequence plays is one of its frames, whole, and they come in order."""
    player = play(vm, content, "--fps", "1", "--loop", "forever")
    wait_until_shown(vm, player)
    known = {frame.rgb: number for number, frame in enumerate(content.frames())}
    seen = []
    deadline = time.monotonic() + 60
    while len(seen) < 2 * content.count and time.monotonic() < deadline:
        number = known[vm.screendump().rgb]  # a torn or foreign picture is no key
        if seen[-1:] != [number]:
            seen.append(number)
    expected = [(seen[0] + i) % content.count for i in range(len(seen))]
    assert len(seen) == 2 * content.count and seen == expected, seen
    player.send(signal.SIGTERM)
    assert player.wait(60).code == 143, player.stderr


VIRTIO = Machine(display="virtio-gpu")


@vm_test(VIRTIO)
def virtio_shows_a_held_frame_exactly(vm):
    shown = check_held_frame(vm, Content(vm, 1920, 1080, 3), 1)
    assert shown["exactness"]["exact"] == "yes", shown["exactness"]
    assert shown["clock"] == "software", shown["clock"]


@vm_test(VIRTIO)
def virtio_shows_every_frame_of_a_sequence_in_order(vm):
    check_sequence(vm, Content(vm, 1920, 1080, 3))


@vm_test(VIRTIO)
def counts_each_frame_of_a_sequence_once(vm):
    content = Content(vm, 1920, 1080, 3)
    player = play(vm, content, "--fps", "3", "--loop", "4")
    result = player.wait(120)
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["outcome"] == "finished" and done["shown"] == 12, done
    assert done["kms"]["flips"] == 12, done["kms"]
    assert done["dropped"] == 0 and done["kms"]["modesets"] == 0, done


@vm_test(Machine(display="bochs"))
def bochs_shows_a_held_frame_exactly(vm):
    check_held_frame(vm, Content(vm, 1920, 1080, 3), 2)


@vm_test(Machine(display="bochs"))
def bochs_shows_every_frame_of_a_sequence_in_order(vm):
    check_sequence(vm, Content(vm, 1920, 1080, 3))


@vm_test(Machine(display="virtio-gpu", width=3840, height=2160))
def virtio_shows_a_held_frame_exactly_at_4k(vm):
    check_held_frame(vm, Content(vm, 3840, 2160, 1), 0)


@vm_test(VIRTIO)
def the_console_comes_back_afterwards(vm):
    content = Content(vm, 1920, 1080, 3)
    vm.check("echo before > /dev/tty1")
    before = vm.screendump()
    check_held_frame(vm, content, 0)
    vm.wait_for_screen(before)


# -- which panel ----------------------------------------------------------------------------------

def identity_of_panel(vm):
    lenticule = require_program(vm, "lenticule")
    panels = json.loads(vm.check([lenticule, "panels", "--json"]).stdout)["panels"]
    [panel] = [panel for panel in panels if panel["connected"]]
    return panel["identity"]


@vm_test(VIRTIO)
def plays_on_the_panel_that_the_rig_names(vm):
    identity = identity_of_panel(vm)
    content = Content(vm, 1920, 1080, 3, identity=(
        f'[identity]\nmanufacturer = "{identity["manufacturer"]}"\n'
        f'edid_sha256 = "{identity["edid_sha256"]}"\n'))
    check_held_frame(vm, content, 0)


@vm_test(VIRTIO)
def refuses_a_panel_that_the_rig_does_not_name(vm):
    content = Content(vm, 1920, 1080, 3, identity='[identity]\nmanufacturer = "XYZ"\n')
    before = vm.screendump()
    result = vm.run(play_command(vm, content), 60)
    assert result.code == 4, result
    assert "XYZ" in result.stderr and "Virtual-1" in result.stderr, result.stderr
    picture.assert_same(vm.screendump(), before)


@vm_test(VIRTIO)
def refuses_a_rig_of_another_size(vm):
    result = vm.run(play_command(vm, Content(vm, 1000, 712, 1)), 60)
    assert result.code == 4, result
    assert "1920x1080" in result.stderr, result.stderr


# -- as a service ---------------------------------------------------------------------------------

def wait_for_lines(process, text, count, timeout):
    """Waits until so many lines begin with text."""
    deadline = time.monotonic() + timeout
    while True:
        lines = [line for line in process.stdout.splitlines() if line.startswith(text)]
        if len(lines) >= count:
            return lines
        assert process.running() and time.monotonic() < deadline, (process.stdout, process.stderr)
        time.sleep(0.1)


def start_service(vm, content, *flags, **options):
    vm.run(["rm", "-f", "/tmp/start"])
    return vm.start([str(HERE / "service_host.py"), "10",
                     *play_command(vm, content, "--loop", "forever", *flags)], **options)


@vm_test(VIRTIO, fresh=True)
def a_killed_player_leaves_its_frame_to_the_next_one(vm):
    """As an ordinary user, with everything that systemd does about it."""
    content = Content(vm, 1920, 1080, 3)
    vm.start_udev()
    service = start_service(vm, content, "--frames", "1:2", uid=1000, groups=("video",))
    for life in range(1, 4):
        wait_for_lines(service, "READY", life, 60)
        vm.wait_for_screen(content.frame(1))
        before = vm.screendump()
        child = wait_for_lines(service, "started", life, 10)[-1].split()[1]
        vm.check(["kill", "-9", child])
        wait_for_lines(service, "ended -9", life, 20)
        time.sleep(2)  # the console would be back by now
        picture.assert_same(vm.screendump(), before)
        vm.check(["touch", "/tmp/start"], uid=1000)
    wait_for_lines(service, "READY", 4, 60)
    vm.wait_for_screen(content.frame(1))
    assert "lit by a modeset" not in service.stderr.partition("\n")[2], service.stderr
    assert service.stderr.count("taken over without a modeset") >= 3, service.stderr


@vm_test(VIRTIO, fresh=True)
def tells_the_service_manager_how_it_is(vm):
    content = Content(vm, 1920, 1080, 3)
    service = start_service(vm, content, "--fps", "2")
    service.wait_for_line("READY 1", 60)
    [status, *_] = wait_for_lines(service, "STATUS EXACT", 1, 20)
    assert status.startswith("STATUS EXACT yes"), status
    wait_for_lines(service, "WATCHDOG 1", 2, 60)
    child = service.wait_for_line("started", 1).split()[1]
    # A process that does not run does not ping.
    vm.check(["kill", "-STOP", child])
    time.sleep(1)
    pings = service.stdout.count("WATCHDOG")
    time.sleep(6)
    assert service.stdout.count("WATCHDOG") == pings, service.stdout
    vm.check(["kill", "-CONT", child])
    wait_for_lines(service, "WATCHDOG 1", pings + 1, 60)
    vm.check(["kill", "-TERM", child])
    service.wait_for_line("STOPPING 1", 30)


@vm_test(VIRTIO, fresh=True)
def waits_for_a_panel_that_is_off_at_the_start(vm):
    content = Content(vm, 1920, 1080, 3)
    vm.start_udev()
    connector = "/sys/class/drm/card0-Virtual-1/status"
    vm.write_file(connector, "off")
    refused = vm.run(play_command(vm, content), 60)
    assert refused.code == 3 and "no panel is connected" in refused.stderr, refused
    player = play(vm, content, "--frames", "2:3", "--loop", "forever", "--wait-for-panel", "forever")
    time.sleep(3)
    assert player.running(), player.stderr
    vm.write_file(connector, "on")
    wait_until_shown(vm, player)
    vm.wait_for_screen(content.frame(2))


# -- vkms: what was composed at which vblank ------------------------------------------------------

VKMS = Machine(modules=("vkms",))
SMALL = (640, 480)


@vm_test(VKMS)
def vkms_composes_every_frame_once_and_in_order(vm):
    """The checksum of each composed picture tells which frame it was."""
    content = Content(vm, *SMALL, 24)
    known = {vkms.expected_crc(frame): number for number, frame in enumerate(content.frames())}
    assert len(known) == content.count
    player = play(vm, content, "--fps", "10", "--loop", "3")
    wait_until_shown(vm, player)
    capture = vkms.start_crc_capture(vm)
    result = player.wait(120)
    capture.kill()
    assert result.code == 0, result.stderr
    done = stats(vm)
    assert done["shown"] == 3 * content.count and done["clock"] == "hardware", done
    assert done["dropped"] == 0 and done["kms"]["flips"] == 3 * content.count, done

    composed = [known[frame.crc] for frame in vkms.parse_crcs(capture.stdout)
                if frame.crc in known]
    foreign = [frame for frame in vkms.parse_crcs(capture.stdout) if frame.crc not in known]
    assert len(composed) > content.count, (len(composed), foreign)
    changes = [number for i, number in enumerate(composed) if i == 0 or composed[i - 1] != number]
    expected = [(changes[0] + i) % content.count for i in range(len(changes))]
    assert changes == expected, changes
    assert changes[-1] == content.count - 1 and len(changes) >= 2 * content.count, changes
    # The console comes back at the end, and nothing else is composed in between.
    assert len({frame.crc for frame in foreign}) <= 1, foreign


@vm_test(VKMS)
def vkms_writes_back_the_frame_that_is_held(vm):
    capture = require_program(vm, "vm_writeback_capture")
    content = Content(vm, 1920, 1080, 3)
    player = play(vm, content, "--frames", "1:2", "--loop", "forever", "--fps", "0.1")
    wait_until_shown(vm, player)
    picture.assert_same(vkms.writeback(vm, player.pid, capture), content.frame(1))
    assert player.running()


# -- doctor ---------------------------------------------------------------------------------------

def doctor(vm, code, *flags):
    result = vm.run([require_program(vm, "lenticule"), "doctor", "--json", *flags], 60)
    assert result.code == code, result
    return json.loads(result.stdout)


def check_healthy(vm, driver):
    found = doctor(vm, 0)
    assert [card["driver"] for card in found["cards"]] == [driver], found["cards"]
    [output] = found["outputs"]
    assert output["exactness"]["exact"] == "yes" and output["tested"], output
    doctor(vm, 3, "--display", "kms:HDMI-A-7")


@vm_test(VIRTIO)
def doctor_finds_virtio_healthy(vm):
    check_healthy(vm, "virtio_gpu")


@vm_test(VKMS)
def doctor_finds_vkms_healthy(vm):
    check_healthy(vm, "vkms")


@vm_test(Machine())
def doctor_says_that_there_is_no_card(vm):
    assert doctor(vm, 3) == {"cards": [], "outputs": []}
