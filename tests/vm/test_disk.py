# SPDX-License-Identifier: Apache-2.0
"""Tests a full file system, which only root can make."""

from vm import SOURCE
from vm_test import Machine, require_program, vm_test

VIRTIO = Machine(display="virtio-gpu")
RIG = "/tmp/tiny.toml"


@vm_test(VIRTIO, slow=True)
def a_full_disk_leaves_no_partial_files(vm):
    program = require_program(vm, "lenticule")
    vm.write_file(RIG, (SOURCE / "scenes/rigs/tiny.toml").read_bytes())
    render = [program, "render", "builtin:teapot", "--rig", RIG, "-o"]
    vm.check(["mkdir", "-p", "/tmp/small"])
    vm.check(render + ["/tmp/small/fits.ppm"])
    vm.check(["rm", "/tmp/small/fits.ppm"])
    vm.check(["mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", "/tmp/small"])
    try:
        result = vm.run(render + ["/tmp/small/o.ppm"])
        left = vm.check(["ls", "-A", "/tmp/small"]).stdout
    finally:
        vm.check(["umount", "/tmp/small"])
    assert result.code == 1, result
    complaint = result.stderr[result.stderr.index("lenticule: "):]
    assert "o.ppm" in complaint and complaint.count("\n") <= 2, result
    assert left == "", left
