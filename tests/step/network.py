# SPDX-License-Identifier: Apache-2.0
"""Network namespaces, and a relay between them that behaves like a bad network.

Each namespace has a loopback device only. A socket remains in the namespace in which it was made, so
that one process can pass datagrams between namespaces that have no other connection.
"""

import ctypes
import fcntl
import math
import os
import select
import socket
import struct

PORT = 7070  # leader's address in its own namespace, and the relay's in the others
MESSAGE_BYTES = 144

LOST = 0.05
DOUBLED = 0.05
DAMAGED = 0.02
OVERTAKEN = 0.05  # delayed until a later message has arrived
TOO_OLD = 0.01    # delayed beyond the age that players accept
DELAY = (0.002, 0.050)
OVERTAKEN_DELAY = (0.110, 0.240)
TOO_OLD_DELAY = (0.300, 1.000)
REPLAY_AGE = 0.5  # seconds; an older message is replayed
FRESH_FOR_WRONG_CLOCKS = (2.0, 2.25)  # ages of messages that look fresh to a clock that is 2 s behind
REMEMBERED = 4000  # messages of each path

_CLONE_NEWUSER = 0x10000000
_CLONE_NEWNET = 0x40000000
_libc = ctypes.CDLL(None, use_errno=True)


class NotPermitted(Exception):
    pass


def _checked(result, what):
    if result != 0:
        raise NotPermitted(f"{what}: {os.strerror(ctypes.get_errno())}")


def enter_user_namespace():
    """Becomes root of a user namespace, unless this is root already."""
    if os.geteuid() == 0:
        return
    user, group = os.getuid(), os.getgid()
    _checked(_libc.unshare(_CLONE_NEWUSER), "a user namespace")
    try:
        for name, text in (("setgroups", "deny"), ("uid_map", f"0 {user} 1"), ("gid_map", f"0 {group} 1")):
            with open(f"/proc/self/{name}", "w") as file:
                file.write(text)
    except OSError as error:
        raise NotPermitted(f"a user namespace: {error}") from error
    # Only a namespace that belongs to the user namespace can be entered again.
    _checked(_libc.unshare(_CLONE_NEWNET), "a network namespace")


class Namespace:
    """Namespace is a network namespace. Inside `with`, this process makes sockets and children there."""

    def __init__(self):
        self._home = os.open("/proc/self/ns/net", os.O_RDONLY)
        _checked(_libc.unshare(_CLONE_NEWNET), "a network namespace")
        self._own = os.open("/proc/self/ns/net", os.O_RDONLY)
        self._bring_loopback_up()
        self.__exit__()

    def __enter__(self):
        _checked(_libc.setns(self._own, _CLONE_NEWNET), "entering a network namespace")

    def __exit__(self, *_):
        _checked(_libc.setns(self._home, _CLONE_NEWNET), "leaving a network namespace")

    @staticmethod
    def _bring_loopback_up():
        set_flags, flag_up = 0x8914, 1
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            fcntl.ioctl(any_socket, set_flags, struct.pack("16sH14x", b"lo", flag_up))

    def udp_socket(self, port):
        with self:
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", port))
        made.setblocking(False)
        return made


class Path:
    """Path is one direction between the leader and a follower."""

    def __init__(self, sink, address):
        self.sink = sink        # socket that delivers
        self.address = address  # address of the receiver; None until the receiver was heard
        self.remembered = []    # (time, datagram) as sent
        self.delivered = 0
        self.damaged = 0        # part of `delivered`
        self.repeated = 0       # part of `delivered`: doubled or replayed


class Relay:
    """Relay passes datagrams between a leader's namespace and those of followers."""

    def __init__(self, leader, followers, scheduler, random):
        self._scheduler = scheduler
        self._random = random
        self.open = True  # False: only replays are delivered
        self.counts = dict.fromkeys(
            ("sent", "lost", "doubled", "damaged", "overtaken", "too_old", "replayed"), 0)
        self.to_leader, self.to_follower = [], []
        self._routes = {}  # socket -> path of what it receives, path back
        for follower in followers:
            front, back = follower.udp_socket(PORT), leader.udp_socket(0)
            there = Path(back, ("127.0.0.1", PORT))
            here = Path(front, None)
            self.to_leader.append(there)
            self.to_follower.append(here)
            self._routes[front] = there, here
            self._routes[back] = here, there

    def paths(self):
        return self.to_leader + self.to_follower

    def wait(self, seconds):
        """Passes on what arrives within this time."""
        for ready in select.select(list(self._routes), [], [], max(seconds, 0.0))[0]:
            path, path_back = self._routes[ready]
            try:
                while True:
                    datagram, sender = ready.recvfrom(2 * MESSAGE_BYTES)
                    if path in self.to_leader:
                        path_back.address = sender
                    self._pass_on(path, datagram)
            except BlockingIOError:
                pass

    def replay_one(self):
        """Delivers an old message again to its receiver; every second one looks fresh to a clock that
        is behind."""
        now = self._scheduler.now()
        path = self._random.choice(self.paths())
        youngest, oldest = self._random.choice(((REPLAY_AGE, math.inf), FRESH_FOR_WRONG_CLOCKS))
        old = [datagram for time, datagram in path.remembered if youngest < now - time < oldest]
        if old:
            self.counts["replayed"] += 1
            self.replay(path, self._random.choice(old))

    def replay(self, path, datagram):
        path.repeated += self._deliver(path, datagram)

    def _pass_on(self, path, datagram):
        if not self.open:
            return
        self.counts["sent"] += 1
        path.remembered.append((self._scheduler.now(), datagram))
        if len(path.remembered) > REMEMBERED:  # keeps some of the whole run
            del path.remembered[self._random.randrange(REMEMBERED)]
        if self._random.random() < LOST:
            self.counts["lost"] += 1
            return
        damaged = self._random.random() < DAMAGED
        if damaged:
            self.counts["damaged"] += 1
            datagram = self._damage(datagram)
        self._deliver_later(path, datagram, damaged=damaged)
        if self._random.random() < DOUBLED:
            self.counts["doubled"] += 1
            self._deliver_later(path, datagram, damaged=damaged, repeated=not damaged)

    def _damage(self, datagram):
        changed = bytearray(datagram)
        changed[self._random.randrange(8, MESSAGE_BYTES)] ^= 1 << self._random.randrange(8)
        return bytes(changed)

    def _delay(self):
        chance = self._random.random()
        if chance < TOO_OLD:
            self.counts["too_old"] += 1
            return self._random.uniform(*TOO_OLD_DELAY)
        if chance < TOO_OLD + OVERTAKEN:
            self.counts["overtaken"] += 1
            return self._random.uniform(*OVERTAKEN_DELAY)
        return self._random.uniform(*DELAY)

    def _deliver_later(self, path, datagram, damaged=False, repeated=False):
        def deliver():
            if self.open and self._deliver(path, datagram):
                path.damaged += damaged
                path.repeated += repeated
        self._scheduler.after(self._delay(), deliver)

    def _deliver(self, path, datagram):
        if path.address is None:
            return 0
        try:
            path.sink.sendto(datagram, path.address)
        except OSError:
            return 0
        path.delivered += 1
        return 1
