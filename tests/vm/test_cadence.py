# SPDX-License-Identifier: Apache-2.0
"""Tests the vblank of each frame over a minute, for content of any rate on a display of 60 Hz.

The measurement is the driver's: vkms reports a checksum of the picture with every vblank's
number. The guest's clock counts its instructions, so what else this host does cannot delay the
player, and a repeat that was not planned is the player's fault or that of the guest's scheduler. None
is allowed. The mode is small, so that composing a picture takes less than a vblank; it is tall because
the kernel makes no timings of 60 Hz for small pictures that are wide.
"""

import dataclasses
import time
from fractions import Fraction

import vkms
from numbered_frames import NumberedFrames, PacedRenderer
from playing import play, stats
from vm_test import Machine, vm_test

WIDTH, HEIGHT = 160, 400
# A due player must not wait for work that the driver has begun.
MACHINE = Machine(modules=("vkms",), clock="instructions",
                  kernel=f"preempt=full video=Virtual-1:{WIDTH}x{HEIGHT}@60")
FRAMES = 60  # number of distinguishable frames; they are played in a loop
RATES = {"24": Fraction(24), "25": Fraction(25), "30": None, "59.94": None, "60": None}


@dataclasses.dataclass(frozen=True)
class Shown:
    number: int
    vblank: int  # the first one that showed it


def planned_rate(text, refresh):
    """Returns the rate; rates close to a whole fraction of the refresh are locked to it."""
    return RATES[text] or refresh / round(refresh / Fraction(text))


def record(vm, content, seconds):
    """Plays; returns the checksum of every vblank, and the player's statistics."""
    frames = NumberedFrames(vm, WIDTH, HEIGHT)
    player = play(vm, frames, "--fps", content, "--loop", "forever", "--duration", str(seconds),
                  "--slots", str(FRAMES + 2), "--prime", str(FRAMES), "--wait", "forever")
    wait_until_it_listens(player)
    vm.write_file(f"{vkms.crc_folder(vm)}/control", "auto")
    capture = vm.start(f"cat {vkms.crc_folder(vm)}/data >/tmp/checksums")
    vm.check("until [ -s /tmp/checksums ]; do sleep 0.1; done", 60)
    PacedRenderer(frames, FRAMES, paced=False)
    result = player.wait(1200)
    capture.kill()
    assert result.code == 0, result.stderr
    return vkms.parse_crcs(vm.read_file("/tmp/checksums").decode()), frames, stats(vm)


def wait_until_it_listens(player):
    deadline = time.monotonic() + 120
    while "waiting for a renderer" not in player.stderr:
        assert player.running() and time.monotonic() < deadline, player.stderr
        time.sleep(0.05)


def shown_frames(composed, numbers):
    """Returns each frame with its first vblank; numbers: frame by checksum. Every vblank from
    the first to the last of them must have been composed, and show one of them."""
    known = [at for at, frame in enumerate(composed) if frame.crc in numbers]
    playing = composed[known[0]:known[-1] + 1]
    assert len(playing) == len(known), [f for f in playing if f.crc not in numbers][:5]
    vblanks = [frame.vblank for frame in playing]
    assert vblanks == list(range(vblanks[0], vblanks[0] + len(vblanks))), "a vblank was skipped"
    shown = [Shown(numbers[frame.crc], frame.vblank) for frame in playing]
    return [s for at, s in enumerate(shown) if at == 0 or shown[at - 1].number != s.number]


def unplanned_repeats(shown, refresh, rate):
    """Returns the delay of the last frame in vblanks. None may be missing or out of order, and none
    too early."""
    assert [s.number for s in shown] == [k % FRAMES for k in range(len(shown))], shown
    late = [s.vblank - shown[0].vblank - k * refresh // rate for k, s in enumerate(shown)]
    assert late == sorted(late) and late[0] == 0, late
    return late[-1]


def check_cadence(vm, content, seconds):
    """Returns the row of the table."""
    composed, frames, done = record(vm, content, seconds)
    numbers = {vkms.expected_crc(frames.frame(number)): number for number in range(FRAMES)}
    assert len(numbers) == FRAMES
    shown = shown_frames(composed, numbers)
    refresh = Fraction(done["refresh"])
    assert 59.9 < refresh < 60.1 and done["clock"] == "hardware", done
    rate = planned_rate(content, refresh)
    assert Fraction(done["content_rate"]) == rate, done
    unplanned = unplanned_repeats(shown, refresh, rate)

    assert done["vblanks"] == int(seconds * refresh), done
    assert len(shown) == done["shown"] == -(-done["vblanks"] * rate // refresh), done
    assert done["repeated_planned"] == done["vblanks"] - done["shown"], done
    assert done["missed_vblanks"] == unplanned == 0, (unplanned, done)
    assert done["repeated_underrun"] == done["dropped"] == 0, done
    return (f"{content:>7} {float(rate):9.4f} {done['vblanks']:8} {len(shown):7} "
            f"{done['repeated_planned']:8} {unplanned:10} {done['missed_vblanks']:9}")


def check_rates(vm, rates, seconds):
    rows = [check_cadence(vm, rate, seconds) for rate in rates]
    print("content played_at  vblanks  frames  planned  unplanned  player's")
    print("                                    repeats    repeats     count")
    print("\n".join(rows), flush=True)


@vm_test(MACHINE, slow=True)
def a_minute_of_each_rate_is_shown_as_planned(vm):
    check_rates(vm, RATES, 60)


@vm_test(MACHINE)
def five_seconds_of_24_and_of_60_are_shown_as_planned(vm):
    check_rates(vm, ["24", "60"], 5)
