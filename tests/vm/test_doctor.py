# SPDX-License-Identifier: Apache-2.0
"""Tests verdict and exit code of lenticule doctor on each kind of machine of docs/play/kms.md."""

import json
import signal

import picture
from content import Content
from playing import play, play_command, stats, wait_until_shown
from vm_test import Machine, require_program, vm_test

VIRTIO = Machine(display="virtio-gpu")
USABLE, USAGE, NO_PANEL, INEXACT = 0, 2, 3, 5


def doctor(vm, code, *flags):
    result = vm.run([require_program(vm, "lenticule"), "doctor", "--json", *flags], 60)
    assert result.code == code, result
    return result


def check_healthy(vm, driver, counts_vblanks):
    found = json.loads(doctor(vm, USABLE).stdout)
    [card] = found["cards"]
    assert card["driver"] == driver and card["problem"] == "", card
    assert card["counts_vblanks"] in (counts_vblanks, None) and card["master_available"], card
    [output] = found["outputs"]
    assert output["panel"]["connector"] == "Virtual-1" and output["problem"] == "", output
    assert output["exactness"]["exact"] == "yes" and output["tested"], output
    assert output["exactness"]["reasons"] == [] and output["exactness"]["unseen"] == [], output
    assert any(driver in line for line in output["exactness"]["proved"]), output
    sound = output["sound"]  # these machines have no sound device of the panel
    assert sound["device"] == "default" and sound["problem"] and sound["remedy"], sound
    # It releases the card for the next program.
    assert json.loads(doctor(vm, USABLE, "--display", "kms:Virtual-1").stdout) == found
    missing = doctor(vm, NO_PANEL, "--display", "kms:HDMI-A-7")
    assert json.loads(missing.stdout)["outputs"] == [], missing
    assert "no such panel is connected" in missing.stderr, missing


@vm_test(VIRTIO)
def finds_virtio_healthy(vm):
    check_healthy(vm, "virtio_gpu", vm.counts_vblanks_by_timer())


@vm_test(Machine(modules=("vkms",)))
def finds_vkms_healthy(vm):
    check_healthy(vm, "vkms", True)


@vm_test(VIRTIO)
def reports_that_virtio_has_no_format_of_ten_bits(vm):
    [output] = json.loads(doctor(vm, INEXACT, "--bits", "10").stdout)["outputs"]
    assert output["problem"] == "" and output["tested"], output
    assert any("XRGB2101010" in reason for reason in output["exactness"]["reasons"]), output
    assert any("panel.bits = 8" in remedy for remedy in output["exactness"]["remedies"]), output


@vm_test(Machine(display="cirrus"))
def reports_that_cirrus_reduces_colours(vm):
    found = json.loads(doctor(vm, INEXACT).stdout)
    [output] = found["outputs"]
    assert output["driver"].startswith("cirrus") and output["exactness"]["exact"] == "no", output
    assert any("RGB565" in reason for reason in output["exactness"]["reasons"]), output


def cirrus_size(vm):
    """Returns a size whose lines are too long for 24 bits; a shorter one where the driver lists none, as
    since Linux 6.12."""
    listed = vm.check("cat /sys/class/drm/card0-*/modes").stdout.split()
    return (1600, 900) if "1600x900" in listed else (800, 600)


@vm_test(Machine(display="cirrus"))
def refuses_to_play_with_reduced_colours(vm):
    size = cirrus_size(vm)
    content = Content(vm, *size, 2)
    command = play_command(vm, content, "--frames", "1:2", "--duration", "2")
    refused = vm.run(command, 60)
    assert refused.code == INEXACT and "RGB565" in refused.stderr, refused
    assert "--allow-inexact" in refused.stderr, refused
    # The refusal was right: with the flag that allows it, most pixels of long lines differ.
    player = play(vm, content, "--frames", "1:2", "--loop", "forever", "--allow-inexact")
    wait_until_shown(vm, player)
    assert stats(vm)["exactness"]["exact"] == "no"
    shown, meant = vm.screendump(), content.frame(1)
    assert (shown.width, shown.height) == size, (shown.width, shown.height)
    differing = picture.differing_pixels(shown, meant)
    assert differing > 1600 * 900 // 2 if size == (1600, 900) else differing == 0, (size, differing)
    player.send(signal.SIGTERM)
    player.wait(30)


@vm_test(Machine())
def reports_a_missing_card(vm):
    result = doctor(vm, NO_PANEL)
    assert json.loads(result.stdout) == {"cards": [], "tiled_panels": [], "outputs": []}, result
    assert "no graphics card was found" in result.stderr, result


@vm_test(Machine())
def refuses_an_invalid_name(vm):
    result = doctor(vm, USAGE, "--display", "kms:edid:")
    assert result.stdout == "" and "edid" in result.stderr, result


@vm_test(VIRTIO, fresh=True)  # plugging in again does not bring the EDID back
def finds_no_panel_if_all_are_unplugged(vm):
    vm.write_file("/sys/class/drm/card0-Virtual-1/status", "off")
    found = json.loads(doctor(vm, NO_PANEL).stdout)
    assert len(found["cards"]) == 1 and found["outputs"] == [], found


@vm_test(VIRTIO)
def reports_that_another_program_is_master(vm):
    player = play(vm, Content(vm, 1920, 1080, 3), "--frames", "1:2", "--loop", "forever")
    wait_until_shown(vm, player)
    result = vm.run([require_program(vm, "lenticule"), "doctor", "--json"], 60)
    [card] = json.loads(result.stdout)["cards"]
    assert card["master_available"] is False, result
