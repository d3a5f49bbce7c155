# SPDX-License-Identifier: Apache-2.0
"""Tests that a list of good items between hostile ones is played to its end without a fault.

A program in the guest looks twenty times a second at the buffer that the driver scans out. Each picture
must be a frame of a good item, in the order of the list; every frame of every good item must be among them, but
those that lie in a time without a look: a busy host may take that from the whole guest.
The memory of the player and of its decoders is bounded by a control group, beyond which the kernel would kill
one.
"""

import itertools
import json
import signal
import time

import hostile_list
import scanout_watch
from hostile_list import DAMAGED, HEIGHT, HOME, LEFT_OUT, WIDTH, HostileList
from test_frames import changes
from vm import HERE
from vm_test import Machine, require_program, vm_test

MACHINE = Machine(modules=("vkms",), memory_mib=3072, kernel=f"video=Virtual-1:{WIDTH}x{HEIGHT}@60")
MEMORY_MIB = 512  # all memory of the player and its decoders, with cached files and kernel buffers
GROUP = "/sys/fs/cgroup/hostile"
LIBRARIES = "/tmp/libraries"
STATS, TRICKS = "/tmp/stats.json", "/tmp/tricks.json"
SHOWN, MEMORY = "/tmp/shown", "/tmp/memory.json"
UNSEEN = None
LONGEST_PAUSE_S = 0.8 / hostile_list.RATE
SECONDS_PER_ROUND = 900  # a bound, not an expectation
SIGNS_OF_A_CRASH = ("segfault", "traps:", "general protection", "oom-kill", "Out of memory", "BUG:")


def start_player(vm, playlist, *flags):
    vm.check(f"mountpoint -q /sys/fs/cgroup || mount -t cgroup2 none /sys/fs/cgroup; mkdir -p {GROUP}; "
             f"echo +memory > /sys/fs/cgroup/cgroup.subtree_control; "
             f"echo {MEMORY_MIB}M > {GROUP}/memory.max; chmod 666 /dev/dri/card*; "
             f"rm -f {STATS}; echo /tmp/core.%e > /proc/sys/kernel/core_pattern")
    copy_libraries(vm)
    enter = (f'ulimit -c unlimited; echo $$ > {GROUP}/cgroup.procs; cd /; '
             'exec setpriv --reuid=1000 --regid=1000 --groups=video -- "$@"')
    player = vm.start(["sh", "-c", enter, "player", require_program(vm, "lenticule"), "play", playlist,
                       "--rig", f"{HOME}/rig.toml", "--display", "kms", "--stats", STATS, *flags],
                      environment={"LD_LIBRARY_PATH": LIBRARIES})
    vm.start(["/usr/bin/python3", HERE / "memory_watch.py", GROUP, MEMORY])
    return player


def copy_libraries(vm):
    """Copies the libraries of all programs into the guest's memory. Each of the many decoders loads some
    hundred, and asking the host for each of them takes longer than everything else."""
    names = ["lenticule", "lenticule-video", "lenticule-pictures", "lenticule-pictures.so"]
    programs = " ".join(require_program(vm, name) for name in names)
    vm.check(f"[ -e {LIBRARIES} ] || {{ mkdir {LIBRARIES} && ldd {programs} | awk '$3 ~ /^\\// {{print $3}}' "
             f"| sort -u | xargs cp -L -t {LIBRARIES}; }}", 300)


def record(vm):
    watch = vm.start(["/usr/bin/python3", HERE / "scanout_watch.py", f"/dev/dri/card{vm.card('vkms')}", SHOWN])
    watch.wait_for_line("looking", 120)
    return watch


def recorded(text):
    """Returns the checksum that each look found, with UNSEEN where there was no look for nearly as long as a
    frame is shown, and the number of looks that were discarded."""
    looks, discarded_looks = [], 0
    for line in text.splitlines():
        checksum, count, discarded, seconds = line.split()
        looks += [UNSEEN] * (float(seconds) > LONGEST_PAUSE_S) + [int(checksum, 16)] * int(count)
        discarded_looks += int(discarded)
    return looks, discarded_looks


def checksum(shown):
    return scanout_watch.checksum_of(*(shown.rgb[channel::3] for channel in (2, 1, 0)))


def play(vm, hostile, seconds, *flags):
    """Plays the list; returns the player's result and what recorded() returns."""
    playlist = hostile.install(1)
    watch = record(vm)
    player = start_player(vm, playlist, *flags)
    vm.write_file(TRICKS, json.dumps({item.source: [item.trick, item.undo] for item in hostile.items
                                      if item.trick}))
    trickster = vm.start(["/usr/bin/python3", HERE / "trickster.py", STATS, TRICKS])
    result = player.wait(seconds)
    assert trickster.running(), trickster.stderr
    watch.send(signal.SIGTERM)
    assert watch.wait(60).code == 0, watch.stderr
    return result, *recorded(vm.read_file(SHOWN).decode())


# -- checks, which judges_test.py tests ---------------------------------------------------------------

def owners_of(good):
    """Returns (place of the item, number of the frame) by checksum; the number is -1 for pictures that
    may be shown and need not be."""
    owners = {}
    for place, item in enumerate(good):
        for number, shown in [*enumerate(item.pictures), *((-1, also) for also in item.also)]:
            known = owners.setdefault(checksum(shown), (place, number))
            assert known[0] == place, f"{item.source} and {good[known[0]].source} look alike"
    return owners


def runs_of(shown, good, owners):
    """Returns a line for each run of equal checksums, to look for a foreign one."""
    def name(crc):
        if crc not in owners:
            return f"no item ({crc:08x})"
        place, number = owners[crc]
        return f"{good[place].source} frame {number}"
    return [f"{len(list(run)):5} times {name(crc)}" for crc, run in itertools.groupby(shown)]


def check_pictures(shown, good, owners):
    """Checks that the items were shown in the order of the list, and each of their frames. shown:
    checksums and UNSEEN, without pictures before the first item and after the last. Returns the rounds."""
    excused = unseen_frames(shown, owners)
    shown = [crc for crc in shown if crc is not UNSEEN]
    foreign = {crc for crc in shown if crc not in owners}
    assert not foreign, (f"{len(foreign)} pictures are of no item:\n"
                         + "\n".join(runs_of(shown, good, owners)))
    places = [owners[crc][0] for crc in shown]
    turns = [place for at, place in enumerate(places) if at == 0 or places[at - 1] != place]
    for at, place in enumerate(turns):
        assert place == at % len(good), (f"{good[place].source} is shown in place of "
                                         f"{good[at % len(good)].source}, in round {at // len(good)}")
    seen = {owners[crc] for crc in shown}
    for place, item in enumerate(good):
        lost = [number for number in range(len(item.pictures)) if (place, number) not in seen | excused]
        assert not lost, f"{item.source}: frames {lost} were not shown"
    missed = excused & set(owners.values()) - seen
    assert len(missed) <= max(2, len(owners) // 20), f"{len(missed)} frames in times without a look"
    if missed:
        print(f"{len(missed):5}  frames in a time without a look", flush=True)
    return len(turns) / len(good)


def unseen_frames(shown, owners):
    """Returns the frames that may have been shown in a time without a look: the one after what was seen before,
    and the one before what was seen next."""
    frames = set()
    for at in (at for at, crc in enumerate(shown) if crc is UNSEEN):
        if shown[at - 1] in owners and shown[at + 1] in owners:
            (place, number), (next_place, next_number) = owners[shown[at - 1]], owners[shown[at + 1]]
            frames |= {(place, number + 1), (next_place, next_number - 1)}
    return frames


def check_reports(printed, items):
    """Checks that each bad item was reported once, and nothing else; returns the number of reports."""
    reports = [line for line in printed.splitlines() if line.startswith(
        (f"{LEFT_OUT}: ", f"{DAMAGED}: ", f"{hostile_list.KEPT}: "))]
    left = list(reports)
    for item in items:
        for report in item.reports:
            beginning = f"{report}: {item.printed()}: "
            found = [line for line in reports if line.startswith(beginning)]
            assert len(found) == 1, f"{beginning}{len(found)} reports\n" + "\n".join(reports)
            left.remove(found[0])
    assert not left, "unexpected reports:\n" + "\n".join(left)
    died = [line for line in reports if "signal" in line or "exit code" in line]
    assert not died, "a decoder died:\n" + "\n".join(died)
    return len(reports)


def without_console(shown, owners):
    """Returns the checksums without those of the console, which the kernel shows before the player's first
    picture and after its end."""
    known = [at for at, crc in enumerate(shown) if crc in owners]
    assert known, "no picture of any item"
    return shown[known[0]:known[-1] + 1]


# -- tests ---------------------------------------------------------------------------------------------

def check_list(vm, hostile, seconds, *flags):
    good, bad = hostile.good(), [item for item in hostile.items if LEFT_OUT in item.reports]
    before = len(vm.kernel_log().splitlines())
    began = time.monotonic()
    result, looks, discarded = play(vm, hostile, seconds, *flags)
    minutes = (time.monotonic() - began) / 60
    assert result.code == 0, (result.code, result.stderr)
    done, memory = json.loads(vm.read_file(STATS)), json.loads(vm.read_file(MEMORY))
    assert done["outcome"] == "finished", done
    log = vm.kernel_log().splitlines()[before:]
    crashes = [line for line in log if any(sign in line for sign in SIGNS_OF_A_CRASH)]
    assert not crashes, crashes
    assert not vm.check("ls /tmp").stdout.count("core."), "a program left a core file"
    owners = owners_of(good)
    shown = without_console(looks, owners)
    rounds = check_pictures(shown, good, owners)
    reports = check_reports(result.stderr, hostile.items)
    skipped = done["playlist"]["items_skipped"]
    assert skipped >= len(bad), done["playlist"]
    damaged = {item["source"] for item in done["playlist"]["damaged_items"]}
    assert damaged == {item.source for item in hostile.items if DAMAGED in item.reports}, damaged
    peak = int(vm.check(f"cat {GROUP}/memory.peak").stdout) / 2**20
    for kind, count in sorted(hostile.counts().items()):
        print(f"{count:5}  {kind}")
    print(f"{len(hostile.items):5}  items; {rounds:.1f} rounds in {minutes:.1f} minutes; "
          f"{len(shown)} looks at {len(set(changes(shown)))} pictures, each one of {len(owners)} known "
          f"({discarded} looks discarded); {reports} reports; {skipped} items left out, {len(damaged)} sources damaged\n"
          f"       memory: at most {memory['own_kib'] / 1024:.0f} MiB of {memory['processes']} "
          f"processes ({memory['resident_kib'] / 1024:.0f} MiB with program files); "
          f"{peak:.0f} MiB with cached files and kernel buffers, of {MEMORY_MIB} MiB", flush=True)
    return rounds


@vm_test(MACHINE)
def every_good_item_is_shown_and_every_bad_one_reported_once(vm):
    rounds = check_list(vm, HostileList(vm, per_kind=1), SECONDS_PER_ROUND)
    assert rounds == 1, rounds


@vm_test(MACHINE, slow=True)
def thirty_minutes_of_bad_items_change_nothing(vm):
    hostile = HostileList(vm)
    assert len(hostile.items) >= 60
    rounds = check_list(vm, hostile, 1800 + SECONDS_PER_ROUND, "--duration", "1800")
    assert rounds >= 1, rounds
