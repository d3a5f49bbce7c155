# SPDX-License-Identifier: Apache-2.0
"""Connects this terminal to a shell in the guest."""

import os
import select
import shutil
import socket
import sys
import termios
import tty

LEAVE = b"\x1d"  # Ctrl-]


def attach(vm):
    """Relays until Ctrl-] or until the guest ends; returns an exit code."""
    with socket.socket(socket.AF_UNIX) as console:
        console.connect(str(vm.console_path()))
        size = shutil.get_terminal_size()
        print(f"{vm.machine}: /tmp is yours, the host's files are read-only; Ctrl-] leaves")
        vm.check(["stty", "-F", "/dev/ttyS2", "cols", str(size.columns), "rows", str(size.lines)])
        vm.request("shell")
        terminal = sys.stdin.fileno()
        saved = termios.tcgetattr(terminal) if os.isatty(terminal) else None
        if saved:
            tty.setraw(terminal)
        try:
            _relay(console, terminal)
        finally:
            if saved:
                termios.tcsetattr(terminal, termios.TCSADRAIN, saved)
    return 0


def _relay(console, terminal):
    while True:
        readable, _, _ = select.select([console, terminal], [], [])
        if console in readable:
            data = console.recv(4096)
            if not data:
                return
            os.write(sys.stdout.fileno(), data)
        if terminal in readable:
            data = os.read(terminal, 4096)
            if not data or LEAVE in data:
                return
            console.sendall(data)
