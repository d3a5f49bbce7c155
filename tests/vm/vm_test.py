# SPDX-License-Identifier: Apache-2.0
"""Declares the decorator that makes a function a test, and the exception that skips.

    @vm_test(Machine(display="bochs"))
    def shows_something(vm): ...
"""

import dataclasses
import typing

from vm import Machine, VirtualMachine  # noqa: F401 (for test files)

ALL_TESTS = []


class Skip(Exception):
    """A prerequisite is missing here; counted, and a failure with LENTICULE_REQUIRE_VM=1."""


@dataclasses.dataclass(frozen=True)
class Test:
    name: str
    machine: Machine
    fresh: bool
    slow: bool
    since: tuple
    function: typing.Callable


def vm_test(machine, fresh=False, slow=False, since=()):
    """Registers a test.

    fresh: the test gets its own machine, because it leaves the machine changed.
    slow: the test takes minutes, and --quick skips it; most have a quick test that covers the same with less.
    since: the series of the kernel that first has what is tested, for example (6, 19). An older kernel
    does not run the test.
    """
    def register(function):
        file = function.__module__.removeprefix("test_")
        ALL_TESTS.append(Test(f"{file}.{function.__name__}", machine, fresh, slow, since,
                              function))
        return function
    return register


def require_program(vm, name):
    """Returns the path of a program of the build tree; skips if it has not been built."""
    try:
        return vm.program(name)
    except FileNotFoundError as problem:
        raise Skip(str(problem)) from None
