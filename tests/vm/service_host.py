#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs in the guest: the part of a service manager that a player uses.

    service_host.py WATCHDOG_SECONDS PROGRAM ARGUMENT...

Starts the program with a notification socket and the descriptors that earlier ones had stored, prints
every message as a line, and starts it again once /tmp/start exists. Ends with the program when that
ends with code 0. Speaks the protocol of sd_notify(3) and sd_listen_fds(3).
"""

import array
import os
import select
import socket
import sys
import time

SOCKET = "/tmp/notify.sock"
START = "/tmp/start"
FIRST = 3  # SD_LISTEN_FDS_START


def say(text):
    print(text, flush=True)


def start(command, watchdog, stored):
    """Starts the child and returns its process id. stored: pairs of name and descriptor."""
    child = os.fork()
    if child:
        say(f"started {child}")
        return child
    spare = [os.dup(fd) for _, fd in stored]
    high = [os.dup2(fd, 100 + i) for i, fd in enumerate(spare)]
    for i, fd in enumerate(high):
        os.dup2(fd, FIRST + i, inheritable=True)
    os.closerange(FIRST + len(high), 200)
    environment = dict(os.environ, NOTIFY_SOCKET=SOCKET, WATCHDOG_USEC=str(watchdog * 1_000_000),
                       LISTEN_PID=str(os.getpid()), LISTEN_FDS=str(len(high)),
                       LISTEN_FDNAMES=":".join(name for name, _ in stored))
    os.execve(command[0], command, environment)


def take_message(listener, stored):
    """Prints a message, stores or drops descriptors, and returns the stored ones."""
    text, ancillary, _, _ = listener.recvmsg(65536, socket.CMSG_SPACE(64))
    fds = array.array("i")
    for level, kind, data in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
            fds.frombytes(data[:len(data) - len(data) % fds.itemsize])
    lines = dict(line.split("=", 1) for line in text.decode().splitlines())
    for key, value in lines.items():
        say(f"{key} {value}")
    name = lines.get("FDNAME")
    if "FDSTOREREMOVE" in lines:
        for _, fd in [entry for entry in stored if entry[0] == name]:
            os.close(fd)
        stored = [entry for entry in stored if entry[0] != name]
    if "FDSTORE" in lines:
        stored = stored + [(name, fd) for fd in fds]
    return stored


def main():
    watchdog, command = int(sys.argv[1]), sys.argv[2:]
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    if os.path.exists(SOCKET):
        os.unlink(SOCKET)
    listener.bind(SOCKET)
    stored = []
    child = start(command, watchdog, stored)
    while True:
        if select.select([listener], [], [], 0.1)[0]:
            stored = take_message(listener, stored)
            continue
        pid, status = os.waitpid(child, os.WNOHANG)
        if not pid:
            continue
        code = os.waitstatus_to_exitcode(status)
        say(f"ended {code}")
        if code == 0:
            return
        while not os.path.exists(START):
            time.sleep(0.05)
        os.unlink(START)
        child = start(command, watchdog, stored)


main()
