# SPDX-License-Identifier: Apache-2.0
"""vivid, a software camera whose HDMI input receives what its output sends."""

from vm_test import Machine, require_program, vm_test

VIVID = Machine(modules=(
    "vivid n_devs=2 node_types=0x101,0x1 num_inputs=1,1 input_types=3,0 "
    "num_outputs=1 output_types=1",))


def node_called(vm, name):
    """Returns the video node whose card name ends so; the order of nodes is undefined."""
    nodes = vm.check("grep -H . /sys/class/video4linux/*/name").stdout
    for line in nodes.splitlines():
        path, _, label = line.partition(":")
        if label == name:
            return "/dev/" + path.split("/")[4]
    raise AssertionError(f"no video node is called {name}:\n{nodes}")


@vm_test(VIVID)
def a_decoder_in_hardware_is_confined_by_debians_kernel(vm):
    """Runs tests with a fake decoder where Landlock has the version of Debian's kernel, and where /dev has
    video devices that are no decoders."""
    rounds = "HardwareVideo.TheConfinedDecoderOpensTheDeviceAgainForEveryRound"
    vm.check([require_program(vm, "video_confinement_tests"), "--gtest_brief=1"], 300)
    vm.check([require_program(vm, "hardware_video_tests"), "--gtest_brief=1",
              f"--gtest_filter=ConfineWithDevices.*:{rounds}"], 300)
