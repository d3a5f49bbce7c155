# SPDX-License-Identifier: Apache-2.0
"""QEMU's machine protocol (QMP): one JSON object per line over a Unix socket, every wait bounded."""

import json
import time


class QmpError(Exception):
    """QEMU refused a command."""


class Qmp:
    """A connection that owns its socket. Thread safety: for one thread."""

    def __init__(self, connection, timeout=10.0):
        self._connection = connection
        self._timeout = timeout
        self._received = b""
        self.events = []
        self._next_message(time.monotonic() + timeout)  # the greeting
        self.execute("qmp_capabilities")

    def execute(self, command, **arguments):
        """Runs one command and returns its result; events meanwhile are kept."""
        request = {"execute": command}
        if arguments:
            request["arguments"] = arguments
        self._connection.settimeout(self._timeout)
        self._connection.sendall(json.dumps(request).encode() + b"\n")
        deadline = time.monotonic() + self._timeout
        while True:
            message = self._next_message(deadline)
            if "event" in message:
                self.events.append(message)
            elif "error" in message:
                raise QmpError(f"{command}: {message['error']['desc']}")
            else:
                return message["return"]

    def _next_message(self, deadline):
        while b"\n" not in self._received:
            self._connection.settimeout(max(0.01, deadline - time.monotonic()))
            try:
                data = self._connection.recv(65536)
            except TimeoutError:
                raise QmpError(f"QEMU did not answer within {self._timeout:.0f} s") from None
            except OSError as problem:
                raise QmpError(f"QEMU is gone ({problem})") from None
            if not data:
                raise QmpError("QEMU closed the connection")
            self._received += data
        line, self._received = self._received.split(b"\n", 1)
        return json.loads(line)
