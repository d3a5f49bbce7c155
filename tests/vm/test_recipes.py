# SPDX-License-Identifier: Apache-2.0
"""Tests recipes of docs/recipes.md on kernel drivers: a button on gpio-sim, a television on vivid's CEC."""

import pathlib
import shutil
import time

from content import Content
from playing import SOCKET, ctl, play, wait_until, wait_until_shown
from test_vivid import node_called
from vm_test import Machine, Skip, require_program, vm_test

REMOTE = pathlib.Path(__file__).resolve().parents[2] / "docs" / "examples" / "remote"
PLAYER = ("--loop", "forever", "--control", SOCKET)
BUTTON = Machine(display="virtio-gpu", width=640, height=480, modules=("gpio-sim",))
TELEVISION = Machine(display="virtio-gpu", width=640, height=480, modules=(
    "vivid n_devs=1 node_types=0x101 num_inputs=1 input_types=3 num_outputs=1 output_types=1",))


def start_recipe(vm, name, *words):
    """Starts a recipe's script, which finds lenticule and the other scripts in PATH."""
    folder = pathlib.Path(require_program(vm, "lenticule")).parent
    return vm.start([REMOTE / name, SOCKET, *words],
                    environment={"PATH": f"{folder}:{REMOTE}:/usr/bin:/bin"})


def require_tool(name):
    if not shutil.which(name):
        raise Skip(f"{name} is not installed; run scripts/packages vm")


class Line:
    """A line of a simulated chip with a button to ground."""

    def __init__(self, vm):
        self._vm = vm
        vm.run("mount -t configfs none /sys/kernel/config")
        vm.check("mkdir -p /sys/kernel/config/gpio-sim/buttons/bank && "
                 "echo 8 > /sys/kernel/config/gpio-sim/buttons/bank/num_lines && "
                 "echo 1 > /sys/kernel/config/gpio-sim/buttons/live")
        read = "cat /sys/kernel/config/gpio-sim/buttons"
        self.chip = vm.check(f"{read}/bank/chip_name").stdout.strip()
        device = vm.check(f"{read}/dev_name").stdout.strip()
        self._pull = f"/sys/devices/platform/{device}/{self.chip}/sim_gpio3/pull"
        self.number = "3"
        if vm.run(["gpioinfo", self.chip]).code != 0:
            raise Skip("this gpiomon needs an interface that the kernel lacks (libgpiod before 2)")
        self.release()

    def press(self):
        self._vm.write_file(self._pull, "pull-down")

    def release(self):
        self._vm.write_file(self._pull, "pull-up")

    def bounce(self, times):
        """Opens and closes the contact within a few milliseconds."""
        self._vm.check(f"for n in $(seq {times}); do echo pull-down > {self._pull}; echo pull-up > {self._pull}; done")


def is_busy(vm):
    """Returns true if the recipe still does a word within the next two seconds: here each takes one."""
    words = "for n in $(seq 20); do cat /proc/*/cmdline; echo; sleep 0.1; done | tr '\\0' ' ' | grep -c 'ctl --socket [^ ]* go'"
    return vm.run(words).stdout.strip() != "0"


@vm_test(BUTTON, slow=True)
def a_button_that_bounces_shows_the_cued_film_once(vm):
    require_tool("gpiomon")
    content = Content(vm, 640, 480, 3)
    line = Line(vm)
    player = play(vm, content, "--frames", "0:1", *PLAYER)
    wait_until_shown(vm, player)
    recipe = start_recipe(vm, "lenticule-button", line.chip, line.number)
    wait_until(lambda: "gpiomon" in vm.run("cat /sys/kernel/debug/gpio").stdout, recipe)
    ctl(vm, "cue", f"{content.guest}/00001.png")
    assert ctl(vm, "status")["displayed"]["source"].endswith("%05d.png")
    line.bounce(5)
    wait_until(lambda: ctl(vm, "status")["displayed"]["source"].endswith("00001.png"))
    vm.wait_for_screen(content.frame(1))
    # What bounced on found no cue, and changed nothing.
    wait_until(lambda: not is_busy(vm), recipe)
    ctl(vm, "cue", f"{content.guest}/00002.png")
    vm.wait_for_screen(content.frame(1))
    line.press()
    wait_until(lambda: ctl(vm, "status")["displayed"]["source"].endswith("00002.png"))
    vm.wait_for_screen(content.frame(2))
    assert recipe.running(), (recipe.stdout, recipe.stderr)


def cec_device(vm, kind):
    """Returns the adapter of vivid's HDMI input (the television) or output (the player)."""
    for device in vm.check("ls /dev/cec*").stdout.split():
        described = vm.check(["cec-ctl", "--device", device]).stdout
        if kind in described:
            return device
    raise AssertionError(f"no CEC adapter is called {kind}")


@vm_test(TELEVISION, slow=True)
def a_television_follows_the_output_and_is_asked(vm):
    require_tool("cec-follower")
    content = Content(vm, 640, 480, 3)
    vm.wait_for_path("/dev/cec1")
    # Since Linux 6.12 no cable leads from the output to the input unless one is plugged in.
    vm.check([require_program(vm, "vm_camera_probe"), "loop", node_called(vm, "vivid-000-vid-cap"), "1"])
    screen, source = cec_device(vm, "vid-cap"), cec_device(vm, "vid-out")
    vm.check(["cec-ctl", "--device", screen, "--tv"])
    television = vm.start(["cec-follower", "--device", screen, "--show-state", "--show-msgs"])
    player = play(vm, content, "--frames", "0:1", *PLAYER)
    wait_until_shown(vm, player)
    recipe = start_recipe(vm, "lenticule-cec", source)
    wait_until(lambda: "subscribe" in vm.run("cat /proc/*/cmdline").stdout, recipe)
    time.sleep(3)  # ctl has connected
    for power, message, said in (("off", "STANDBY", "standby"), ("on", "IMAGE_VIEW_ON", "on")):
        ctl(vm, "power", power)
        wait_until(lambda: message in television.stdout, television, recipe)
        wait_until(lambda: f"television: {said}" in recipe.stderr.replace("to-", ""),
                   television, recipe)
    assert "asked twice" not in recipe.stderr, recipe.stderr
    # A television without power does not answer.
    television.kill()
    vm.check(["cec-ctl", "--device", screen, "--clear"])
    ctl(vm, "power", "off")
    wait_until(lambda: "asked twice for standby, it says nothing" in recipe.stderr, recipe)
    assert recipe.running(), (recipe.stdout, recipe.stderr)
