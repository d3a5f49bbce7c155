# SPDX-License-Identifier: Apache-2.0
"""Tests that QEMU's screendump returns exactly the bytes that a driver scans out."""

import picture
from vm_test import Machine, vm_test


def card_status(vm):
    connectors = vm.check("grep -H . /sys/class/drm/card0-*/status /sys/class/drm/card0-*/modes")
    return connectors.stdout


def show_on_framebuffer(vm, shown):
    """Writes a picture into /dev/fb0 while the console does not draw."""
    vm.run("for c in /sys/class/vtconsole/*/bind; do echo 0 > $c; done")
    stride = int(vm.read_file("/sys/class/graphics/fb0/stride"))
    assert stride == shown.width * 4, stride
    vm.write_file("/dev/fb0", shown.xrgb())


def check_screen(vm, width, height):
    assert f"modes:{width}x{height}" in card_status(vm), card_status(vm)
    shown = picture.noise(width, height, seed=width)
    show_on_framebuffer(vm, shown)
    vm.wait_for_screen(shown)
    # The comparison must detect the smallest change: one step of one subpixel.
    x, y = width - 1, height // 2
    red, green, blue = shown.pixel(x, y)
    changed = shown.with_pixel(x, y, (red, green ^ 1, blue))
    assert picture.differing_pixels(vm.screendump(), changed) == 1
    show_on_framebuffer(vm, changed)
    vm.wait_for_screen(changed)
    assert picture.differing_pixels(vm.screendump(), shown) == 1


@vm_test(Machine(display="virtio-gpu"))
def virtio_shows_every_pixel(vm):
    check_screen(vm, 1920, 1080)


@vm_test(Machine(display="virtio-gpu", width=3840, height=2160))
def virtio_shows_every_pixel_at_4k(vm):
    check_screen(vm, 3840, 2160)


@vm_test(Machine(display="bochs"))
def bochs_shows_every_pixel(vm):
    check_screen(vm, 1920, 1080)
