# SPDX-License-Identifier: Apache-2.0
"""What a test file imports: the mark that makes a function a test, and the way to skip.

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
    function: typing.Callable


def vm_test(machine, fresh=False, slow=False):
    """Registers a test.

    fresh: it gets a machine of its own, because it leaves it changed.
    slow: it takes minutes and --quick leaves it out; a quick test proves the same for less.
    """
    def register(function):
        file = function.__module__.removeprefix("test_")
        ALL_TESTS.append(Test(f"{file}.{function.__name__}", machine, fresh, slow,
                              function))
        return function
    return register


def require_program(vm, name):
    """The path of a program of the build tree; skips where it has not been built."""
    try:
        return vm.program(name)
    except FileNotFoundError as problem:
        raise Skip(str(problem)) from None
