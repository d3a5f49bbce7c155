# SPDX-License-Identifier: Apache-2.0
"""A virtual machine that runs this machine's own programs under Debian's kernel, for tests.

    with VirtualMachine(Machine(display="virtio-gpu", width=1920, height=1080)) as vm:
        print(vm.check(["uname", "-r"]).stdout)
        seen = vm.screendump()

Commands go to guest_agent over a serial port; their scripts, output and files go through a folder
that both sides see. Every wait has an end, QEMU dies with this process, and nothing that the guest
does reaches the host's files outside that folder.
"""

import contextlib
import ctypes
import dataclasses
import os
import pathlib
import shlex
import shutil
import signal
import socket
import subprocess
import tempfile
import time

import guest_files
import picture
import qmp

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parents[1]

BOOT_SECONDS = 120
KVM_PROBE_SECONDS = 20

KERNEL_ARGUMENTS = (
    "console=ttyS0 panic=-1 loglevel=4 mitigations=off audit=0 apparmor=0 nowatchdog "
    "no_timer_check rcupdate.rcu_expedited=1 vt.global_cursor_default=0 consoleblank=0 "
    "random.trust_cpu=on sysrq_always_enabled")


class VmError(Exception):
    """The machine itself failed: it did not start, died, or stopped answering."""


class MachineStalled(VmError):
    """The machine runs, but even SIGKILL has no effect, which no program can cause."""


class CommandFailed(AssertionError):
    """A command in the guest failed though it had to succeed."""


@dataclasses.dataclass(frozen=True)
class Machine:
    """The machine that a test needs. Tests with equal needs share one booted machine."""

    display: str = "none"  # QEMU's display device: virtio-gpu, bochs, cirrus or none
    width: int = 1920  # the display's preferred mode
    height: int = 1080
    outputs: int = 1  # of virtio-gpu
    memory_mib: int = 2048
    disk_mib: int = 0  # an empty disk, /dev/vda, which survives lose_power()
    modules: tuple = ()  # module names, each with its parameters: ("vkms enable_cursor=0",)
    kernel: str = ""  # further arguments for the kernel
    processors: int = 2  # one takes a third less of the host's time; tests of races need two
    clock: str = "real"  # or "instructions": the guest's time is the number of executed instructions

    def __str__(self):
        display = self.display
        if display != "none":
            display += f" {self.width}x{self.height}"
        if self.outputs > 1:
            display += f" x {self.outputs} outputs"
        processors = ["one processor"] if self.processors == 1 else []
        clock = ["time by instructions"] if self.clock == "instructions" else []
        disk = [f"disk {self.disk_mib} MiB"] if self.disk_mib else []
        return " + ".join([display, *disk, *(module.split()[0] for module in self.modules), *processors,
                           *clock])


@dataclasses.dataclass(frozen=True)
class Result:
    """The result of a finished command. code is 128 + N if signal N ended it."""

    code: int
    stdout: str
    stderr: str


class Process:
    """A program running in the guest."""

    def __init__(self, vm, number, command):
        self._vm = vm
        self.number = number
        self.command = command
        self.folder = vm.exchange / str(number)
        self.code = None

    @property
    def pid(self):
        """Returns the guest's process id of the program itself, not of a shell around it."""
        deadline = time.monotonic() + 10
        while time.monotonic() < deadline:
            text = self._text("pid")
            if text.endswith("\n"):
                return int(text)
            time.sleep(0.02)
        raise VmError(f"'{self.command}' did not start within 10 s")

    @property
    def stdout(self):
        """Returns the output so far."""
        return self._text("stdout")

    @property
    def stderr(self):
        return self._text("stderr")

    def running(self):
        self._vm.listen(0)
        return self.code is None

    def send(self, number):
        """Sends the program a signal, for example signal.SIGTERM."""
        self._vm.check(["kill", f"-{int(number)}", str(self.pid)])

    def wait(self, timeout):
        """Returns the Result; kills the program and raises after the timeout."""
        if not self._vm.listen(timeout, until=lambda: self.code is not None):
            self.kill()
            raise CommandFailed(f"'{self.command}' was not done after {timeout} s\n"
                                f"{self.stdout[-2000:]}{self.stderr[-4000:]}")
        return Result(self.code, self.stdout, self.stderr)

    def kill(self):
        """Ends the program and its children with SIGKILL and waits for their end."""
        if self.code is None:
            self._vm.request(f"kill {self.number}")
            if not self._vm.listen(20, until=lambda: self.code is not None):
                raise MachineStalled(f"'{self.command}' survived SIGKILL for 20 s\n"
                                     f"{self._vm.state_of_kernel()}")

    def wait_for_line(self, text, timeout):
        """Waits until its standard output has a line that begins with text; returns that line."""
        deadline = time.monotonic() + timeout
        while True:
            ended = not self.running()
            for line in self.stdout.splitlines(keepends=True):
                if line.startswith(text) and line.endswith("\n"):
                    return line.rstrip("\n")
            if ended or time.monotonic() > deadline:
                state = f"ended with code {self.code}" if ended else f"ran {timeout} s"
                raise CommandFailed(f"'{self.command}' {state} without a line '{text}'\n"
                                    f"{self.stdout[-2000:]}{self.stderr[-4000:]}")
            self._vm.listen(0.05)

    def _text(self, name):
        try:
            return (self.folder / name).read_text(errors="replace")
        except FileNotFoundError:
            return ""


class VirtualMachine:
    """Boots in its constructor; close() or `with` ends it. For one thread."""

    def __init__(self, machine, files, build=None, accelerator="tcg", boot_seconds=BOOT_SECONDS,
                 boots=2):
        """files: the result of guest_files.files_of(). build: a build tree for the guest.

        boots: how often it may be booted until the agent answers. An emulated processor now and then
        loses a timer before any of our code runs, and the kernel waits for it for ever.
        """
        self.machine = machine
        self.files = pathlib.Path(files)
        self.build = pathlib.Path(build).resolve() if build else None
        self.keep = False
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="lenticule-vm-"))
        self.exchange = self.folder / "exchange"
        self.exchange.mkdir()
        if machine.disk_mib:
            with open(self.folder / "disk.img", "wb") as disk:
                disk.truncate(machine.disk_mib << 20)
        self._boot = (accelerator, boot_seconds, boots)
        self._processes = {}
        self._count = 0
        self._received = b""
        self._ready = False
        self._qemu = None
        self._agent = None
        self._qmp_connection = None
        self._qmp = None
        try:
            self._start(*self._boot)
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    # -- commands ---------------------------------------------------------------------------------

    def start(self, command, uid=0, groups=(), environment=None):
        """Starts a command in the guest's /tmp. A list is run as it is, a string by a shell.

        uid 1000 is an ordinary user; groups are the names of further groups that it is in.
        """
        words = ["sh", "-c", command] if isinstance(command, str) else [str(w) for w in command]
        if environment:
            words = ["env", *(f"{name}={value}" for name, value in environment.items()), *words]
        if uid:
            membership = [f"--groups={','.join(groups)}"] if groups else ["--clear-groups"]
            words = ["setpriv", f"--reuid={uid}", f"--regid={uid}", *membership, "--", *words]
        self._count += 1
        process = Process(self, self._count, command if isinstance(command, str)
                          else shlex.join(words))
        process.folder.mkdir()
        (process.folder / "command").write_text(f"exec {shlex.join(words)}\n")
        self._processes[self._count] = process
        self.request(f"run {self._count}")
        return process

    def run(self, command, timeout=60, **options):
        """Runs a command to its end and returns its Result. Options: see start()."""
        return self.start(command, **options).wait(timeout)

    def check(self, command, timeout=60, **options):
        """Runs a command that must succeed."""
        result = self.run(command, timeout, **options)
        if result.code != 0:
            raise CommandFailed(f"'{command}' ended with code {result.code}\n"
                                f"{result.stdout[-2000:]}{result.stderr[-4000:]}")
        return result

    def program(self, name):
        """Returns the path of a program of the build tree, which is the same in the guest."""
        for folder, folders, names in os.walk(self.build or ""):
            folders[:] = [f for f in folders if f != "CMakeFiles"]
            path = pathlib.Path(folder) / name
            if name in names and os.access(path, os.X_OK):
                return str(path)
        raise FileNotFoundError(f"{name} is not in {self.build or 'a build tree (--build)'}")

    # -- files, modules, devices ------------------------------------------------------------------

    def read_file(self, path):
        """Returns a guest file's bytes, also of files in /sys and /proc of unknown length."""
        self._count += 1
        copy = self.exchange / f"file-{self._count}"
        self.check(["sh", "-c", f"cat {shlex.quote(str(path))} > /exchange/{copy.name}"])
        data = copy.read_bytes()
        copy.unlink()
        return data

    def write_file(self, path, data):
        """Writes bytes or text into a guest file, in one piece as /sys wants it."""
        self._count += 1
        copy = self.exchange / f"file-{self._count}"
        copy.write_bytes(data.encode() if isinstance(data, str) else data)
        self.check(["dd", f"if=/exchange/{copy.name}", f"of={path}", "bs=4M", "status=none"])
        copy.unlink()

    def load_module(self, name, *parameters):
        self.check(["modprobe", name, *parameters])

    def wait_for_path(self, path, timeout=20):
        self.check(f"until [ -e {shlex.quote(path)} ]; do sleep 0.05; done", timeout)

    def card(self, driver):
        """Returns the number N of /dev/dri/cardN that a driver serves."""
        names = self.check("grep -H . /sys/kernel/debug/dri/*/name").stdout
        for line in names.splitlines():
            path, _, name = line.partition(":")
            number = path.split("/")[5]  # newer kernels also have folders with the devices' names
            if name.split()[0] == driver and number.isdigit() and int(number) < 64:
                return int(number)
        raise CommandFailed(f"no card is served by {driver}:\n{names}")

    def start_udev(self):
        """Runs udevd as a Debian system does: rules, groups, links, events for libudev."""
        self.check(["mkdir", "-p", "/run/udev"])
        self.check(["/lib/systemd/systemd-udevd", "--daemon"])
        self.check(["udevadm", "trigger", "--action=add", "--subsystem-match=drm",
                    "--subsystem-match=video4linux", "--subsystem-match=graphics"])
        self.check(["udevadm", "settle", "--timeout=30"])

    def state_of_kernel(self):
        """Returns the blocked tasks; uses the keyboard, which works if nothing else does."""
        for question in ["w", "l"]:
            with contextlib.suppress(qmp.QmpError):
                self.qmp("send-key", keys=[{"type": "qcode", "data": key}
                                           for key in ["alt", "sysrq", question]])
            time.sleep(2)
        return self.logs(300)

    def counts_vblanks_by_timer(self):
        """Returns true for kernels in which drivers without vblanks count them by a timer."""
        return guest_files.series_of(self.files) >= (6, 19)

    def kernel_log(self):
        return self.check(["dmesg"]).stdout

    # -- the display as QEMU sees it --------------------------------------------------------------

    def qmp(self, command, **arguments):
        return self._qmp.execute(command, **arguments)

    def screendump(self, head=0):
        """Returns the picture that an output of QEMU's display device scans out now."""
        path = self.folder / "screen.ppm"
        self.qmp("screendump", filename=str(path), device="display0", head=head)
        return picture.read(path)

    def wait_for_screen(self, expected, timeout=20, head=0):
        """Waits until the screen shows exactly this picture; fails with the difference."""
        deadline = time.monotonic() + timeout
        seen = self.screendump(head)
        while seen != expected and time.monotonic() < deadline:
            time.sleep(0.1)
            seen = self.screendump(head)
        picture.assert_same(seen, expected)

    # -- the conversation with the agent ----------------------------------------------------------

    def request(self, line):
        try:
            self._agent.sendall(line.encode() + b"\n")
        except OSError as problem:
            raise VmError(f"the machine is gone ({problem})\n{self.logs()}") from None

    def listen(self, timeout, until=None):
        """Reads the agent's answers until a condition holds; returns false after the timeout."""
        deadline = time.monotonic() + timeout
        while not (until and until()):
            left = deadline - time.monotonic()
            self._agent.settimeout(max(left, 0.001))
            try:
                data = self._agent.recv(65536)
            except TimeoutError:
                return bool(until and until())
            except OSError as problem:
                raise VmError(f"the machine is gone ({problem})\n{self.logs()}") from None
            if not data:
                raise VmError(f"the machine ended by itself\n{self.logs()}")
            self._received += data
            *lines, self._received = self._received.split(b"\n")
            for line in lines:
                self._take(line.split())
            if left <= 0:
                break
        return True if until is None else until()

    def _take(self, words):
        if words[:1] == [b"ready"]:
            self._ready = True
        elif words[:1] == [b"done"] and len(words) == 3:
            process = self._processes.pop(int(words[1]), None)
            if process:
                process.code = int(words[2])

    # -- life -------------------------------------------------------------------------------------

    def end_processes(self):
        """Kills processes that a test left running."""
        for process in list(self._processes.values()):
            process.kill()

    def logs(self, lines=40):
        """Returns the end of the console's and QEMU's output, for a failure's report."""
        parts = []
        for name in ["qemu.log", "console.log"]:
            path = self.folder / name
            text = path.read_text(errors="replace").splitlines() if path.exists() else []
            if text:
                parts += [f"--- {name}", *text[-lines:]]
        return "\n".join(parts)

    def lose_power(self):
        """Ends the machine as a power failure does, and boots it again. Only its disk is kept."""
        self._end_qemu()
        self._processes = {}
        self._received = b""
        self._ready = False
        self._start(*self._boot)

    def _end_qemu(self):
        if self._qemu and self._qemu.poll() is None:
            self._qemu.kill()
            self._qemu.wait(20)
        for connection in [self._agent, self._qmp_connection]:
            if connection:
                connection.close()
        self._agent = self._qmp = None

    def processor_seconds(self):
        """Returns the processor time of a running QEMU, which runs all of the guest."""
        try:
            status = pathlib.Path(f"/proc/{self._qemu.pid}/stat").read_text()
        except FileNotFoundError:  # ended and waited for: a part of this process's children
            return 0.0
        user, system = status.rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def close(self):
        """Ends QEMU. The folder with its logs goes too, unless keep is set."""
        self._end_qemu()
        if not self.keep:
            shutil.rmtree(self.folder, ignore_errors=True)

    def console_path(self):
        """Returns the Unix socket of the shell's serial port."""
        return self.folder / "shell.sock"

    def _start(self, accelerator, boot_seconds, boots):
        while not self._boots(accelerator, boot_seconds):
            boots -= 1
            problem = f"no agent after {boot_seconds} s"
            if boots == 0:
                raise VmError(f"{problem}\n{self.logs()}")
            print(f"booting again: {problem}\n{self.logs(4)}", flush=True)
            self._end_qemu()
        self._load_drivers()

    def _boots(self, accelerator, boot_seconds):
        """Starts QEMU; returns whether the agent answers in time."""
        self._received = b""
        log = open(self.folder / "qemu.log", "wb")
        with log:
            self._qemu = subprocess.Popen(self._command(accelerator), stdin=subprocess.DEVNULL,
                                          stdout=log, stderr=log, preexec_fn=_die_with_parent)
        self._agent = self._connect("agent.sock")
        self._qmp_connection = self._connect("qmp.sock")
        self._qmp = qmp.Qmp(self._qmp_connection)
        return self.listen(boot_seconds, until=lambda: self._ready)

    def _load_drivers(self):
        driver = {"virtio-gpu": "virtio-gpu", "bochs": "bochs", "cirrus": "cirrus"}.get(self.machine.display)
        for module in [driver, *self.machine.modules]:
            if module:
                self.load_module(*module.split())
        if driver:
            self.wait_for_path("/dev/fb0")

    def _connect(self, name):
        deadline = time.monotonic() + 20
        while True:
            connection = socket.socket(socket.AF_UNIX)
            try:
                connection.connect(str(self.folder / name))
                return connection
            except OSError:
                connection.close()
                if self._qemu.poll() is not None or time.monotonic() > deadline:
                    raise VmError(f"QEMU did not start\n{self.logs()}") from None
                time.sleep(0.02)

    def _command(self, accelerator):
        release = guest_files.release_of(self.files)
        modules = self.files / "kernel" / "lib" / "modules" / release
        visible = [SOURCE, self.files] + ([self.build] if self.build else [])
        arguments = (f"{KERNEL_ARGUMENTS} {self.machine.kernel} vm_agent={HERE}/guest_agent "
                     f"vm_modules={modules} vm_visible={':'.join(map(str, visible))}")
        return [
            "qemu-system-x86_64", "-nodefaults", "-no-user-config", "-display", "none",
            "-no-reboot", "-m", str(self.machine.memory_mib),
            *_processor_arguments(self.machine, accelerator),
            "-kernel", str(self.files / "vmlinux"), "-append", arguments,
            "-initrd", str(self.files / "initramfs.cpio"),
            "-serial", f"file:{self.folder}/console.log",
            "-serial", f"unix:{self.folder}/agent.sock,server=on,wait=off",
            "-serial", f"unix:{self.console_path()},server=on,wait=off",
            "-qmp", f"unix:{self.folder}/qmp.sock,server=on,wait=off",
            *_shared_folder("host", "/", "readonly=on"),
            *_shared_folder("exchange", self.exchange, "readonly=off"),
            *_disk_arguments(self.machine, self.folder),
            *_display_arguments(self.machine)]


def _shared_folder(tag, path, access):
    return ["-fsdev", f"local,id={tag},path={path},security_model=none,multidevs=remap,{access}",
            "-device", f"virtio-9p-pci,fsdev={tag},mount_tag={tag}"]


def _disk_arguments(machine, folder):
    if not machine.disk_mib:
        return []
    return ["-drive", f"file={folder}/disk.img,if=none,id=disk,format=raw,cache=writethrough",
            "-device", "virtio-blk-pci,drive=disk"]


def _display_arguments(machine):
    size = f"xres={machine.width},yres={machine.height}"
    if machine.display == "virtio-gpu":
        # The default of 256 MiB silently holds only 7 buffers of 3840x2160.
        return ["-device", f"virtio-gpu-pci,id=display0,{size},max_hostmem=1G,"
                f"max_outputs={machine.outputs}"]
    if machine.display == "bochs":
        return ["-device", f"bochs-display,id=display0,{size},vgamem=64M"]
    if machine.display == "cirrus":  # takes no size; its driver lists modes up to 1600x900
        return ["-device", "cirrus-vga,id=display0,vgamem_mb=16"]
    if machine.display == "none":
        return []
    raise ValueError(f"unknown display device '{machine.display}'")


# Without erms. With it, kernel and C library copy and clear memory by "rep movsb" and "rep stosb", which
# QEMU emulates byte by byte.
EMULATED_PROCESSOR = "max,erms=off"


def _processor_arguments(machine, accelerator):
    if machine.clock == "instructions":
        # A nanosecond per instruction; an idle guest is at its next timer at once. With a second
        # processor Debian's kernel does not come up under this clock.
        return ["-accel", "tcg,thread=single", "-cpu", EMULATED_PROCESSOR,
                "-icount", "shift=0,sleep=off"]
    processors = ["-smp", str(machine.processors)]
    if accelerator == "kvm":
        return ["-accel", "kvm", "-cpu", "host", *processors]
    return ["-accel", "tcg,thread=multi", "-cpu", EMULATED_PROCESSOR, *processors]


def _die_with_parent():
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def choose_accelerator(files):
    """Returns kvm if a machine really boots with it, else tcg; LENTICULE_VM_ACCEL overrides.

    /dev/kvm can exist, open and create a machine, and QEMU still abort a moment later, so the
    probe is a boot. Its outcome is kept until this host restarts.
    """
    chosen = os.environ.get("LENTICULE_VM_ACCEL")
    if chosen:
        return chosen
    if not os.access("/dev/kvm", os.R_OK | os.W_OK):
        return "tcg"
    boot = pathlib.Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    memory = guest_files.OUTPUT.with_suffix(".accelerator")
    if memory.exists() and memory.read_text().split()[1:] == [boot]:
        return memory.read_text().split()[0]
    try:
        VirtualMachine(Machine(), files, accelerator="kvm",
                       boot_seconds=KVM_PROBE_SECONDS, boots=1).close()
        works = "kvm"
    except (VmError, qmp.QmpError):
        works = "tcg"
    memory.write_text(f"{works} {boot}\n")
    return works
