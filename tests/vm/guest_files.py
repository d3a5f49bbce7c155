# SPDX-License-Identifier: Apache-2.0
"""Prepares the files of the virtual machines in build/vm: Debian's kernel, two more drivers, an initramfs.

The kernel package is unpacked, never installed on this machine. vkms, the driver with a timer's
vblanks and a writeback connector, and gpio-sim, whose lines are set by files, are not in all of Debian's
kernels and are built from its source.
Does nothing if all files exist: the kernel's part is made again when its version or LAYOUT changes,
the initramfs when guest_init does.

The kernel of another Debian is prepared in a root of that suite (scripts/in-debian), because its modules
need its own compiler; the machines read the result there.
"""

import contextlib
import fcntl
import hashlib
import lzma
import os
import pathlib
import platform
import shutil
import struct
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
OUTPUT = pathlib.Path(os.environ.get("LENTICULE_VM_DIR", HERE.parents[1] / "build" / "vm"))
LAYOUT = 3  # to be raised with every change of make_kernel's output
HEADERS = pathlib.Path("/usr/src")
VKMS_SOURCE = "drivers/gpu/drm/vkms"
GPIO_SIM_SOURCE = "drivers/gpio/gpio-sim.c"
GPIO_HEADER = "drivers/gpio/gpiolib.h"
IRQ_SIM_SOURCE = "kernel/irq/irq_sim.c"
SUITES = {"6.1": "bookworm", "6.12": "trixie"}  # that have this series of the kernel
BUSYBOX = pathlib.Path("/bin/busybox")

# Modules of the guest's first process before it can read the host's files; every other module is
# read from there when needed.
BOOT_MODULES = ["virtio_pci", "9pnet_virtio", "9p", "overlay"]


class Unprepared(Exception):
    """A prerequisite is missing; the text names it and the remedy."""


def say(text):
    print(f"vm: {text}", file=sys.stderr, flush=True)


def run(command, hint, minutes=10, **options):
    """Runs a command and hides its output unless it fails."""
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              timeout=60 * minutes, **options)
    except FileNotFoundError:
        raise Unprepared(f"{command[0]} is not installed; {hint}") from None
    except subprocess.TimeoutExpired:
        raise Unprepared(f"{' '.join(map(str, command))} took more than {minutes} minutes") from None
    if done.returncode != 0:
        output = done.stdout.decode(errors="replace").strip()
        raise Unprepared(f"{' '.join(map(str, command))} failed; {hint}\n{output[-4000:]}")
    return done.stdout.decode(errors="replace")


def kernel_release():
    """Returns the newest amd64 kernel whose headers are installed, for example 6.1.0-30-amd64."""
    found = [folder.name.removeprefix("linux-headers-")
             for folder in HEADERS.glob("linux-headers-*-amd64")]
    if not found:
        raise Unprepared("the headers of Debian's kernel are not installed; "
                         "run scripts/packages vm")

    def version(release):
        return [int(part) for part in release.replace("-", ".").split(".") if part.isdigit()]
    return max(found, key=version)


def package_version(package):
    query = subprocess.run(["dpkg-query", "-W", "-f=${Version}", package], capture_output=True,
                           text=True)
    return query.stdout.strip()


def fetch_kernel(release):
    """Unpacks the image package that the headers belong to, and its parts, into OUTPUT/kernel."""
    version = package_version(f"linux-headers-{release}")
    image = f"linux-image-{release}"
    hint = "is a Debian mirror reachable, and are the package lists fresh (apt-get update)?"
    # Since Linux 7.2 the image package is empty and depends on packages with kernel and modules.
    needed = run(["apt-cache", "depends", "--important", image], hint).split()
    packages = [f"{package}={version}" if version else package
                for package in [image, *(word for word in needed[1:] if word.endswith(f"-{release}"))]]
    say(f"fetching {' '.join(packages)}")
    download = OUTPUT / "download"
    download.mkdir()
    # apt would drop its rights to a user who cannot write here.
    run(["apt-get", "-o", "APT::Sandbox::User=", "download", *packages], hint, cwd=download)
    for archive in download.glob("*.deb"):
        run(["dpkg-deb", "-x", archive, OUTPUT / "kernel"], "is there room on the disk?")
    shutil.rmtree(download)
    if not (OUTPUT / "kernel" / "lib").exists():  # since Debian 13
        (OUTPUT / "kernel" / "lib").symlink_to("usr/lib")


def unpack_kernel(release):
    """Writes OUTPUT/vmlinux, the kernel without its self-extracting wrapper.

    QEMU starts it directly (PVH); emulating the decompression would take several seconds a boot.
    Offsets are those of the Linux boot protocol: setup_sects, payload_offset, payload_length.
    """
    image = kernel_image(release).read_bytes()
    start = (image[0x1F1] + 1) * 512
    offset, length = struct.unpack_from("<II", image, 0x248)
    payload = image[start + offset:start + offset + length - 4]  # its last word is the size of the kernel
    if payload.startswith(b"\xfd7zXZ"):
        (OUTPUT / "vmlinux").write_bytes(lzma.decompress(payload))
    elif payload.startswith(b"\x28\xb5\x2f\xfd"):
        (OUTPUT / "vmlinux.zst").write_bytes(payload)
        run(["zstd", "-d", "--rm", "-q", OUTPUT / "vmlinux.zst"], "run scripts/packages vm")
    else:
        raise Unprepared(f"the kernel of {release} is packed with neither xz nor zstd; "
                         "unpack_kernel must learn its format")


def kernel_image(release):
    """Returns the path of the bootable image, which is beside the modules since Linux 7.2."""
    kernel = OUTPUT / "kernel"
    image = kernel / "boot" / f"vmlinuz-{release}"
    return image if image.exists() else kernel / "lib" / "modules" / release / "vmlinuz"


def kernel_sources(release):
    """Unpacks the sources of the modules that Debian does not build; returns their tree."""
    series = ".".join(release.split(".")[:2])
    archive = HEADERS / f"linux-source-{series}.tar.xz"
    if not archive.exists():
        raise Unprepared(f"{archive} is missing; run scripts/packages vm")
    tree = f"linux-source-{series}"
    say("unpacking the sources of vkms and gpio-sim")
    run(["tar", "-xJf", archive, "-C", OUTPUT,
         *(f"{tree}/{name}" for name in [VKMS_SOURCE, GPIO_SIM_SOURCE, GPIO_HEADER, IRQ_SIM_SOURCE])],
        "is there room on the disk?")
    return OUTPUT / tree


def build_module(release, source, modules, name, *settings):
    """Builds a module against the guest's kernel and puts it among the kernel's own modules."""
    say(f"building {name}.ko")
    run(["make", "-C", HEADERS / f"linux-headers-{release}", f"M={source}", *settings,
         f"-j{os.cpu_count()}", "modules"], "are the headers of this kernel complete?")
    (modules / "updates").mkdir(exist_ok=True)
    shutil.copy(source / f"{name}.ko", modules / "updates")


def build_modules(release, modules):
    """Builds the drivers that the kernel's packages lack."""
    tree = kernel_sources(release)
    if not any(modules.rglob("vkms.ko*")):
        build_module(release, tree / VKMS_SOURCE, modules, "vkms", "CONFIG_DRM_VKMS=m")
    if not any(modules.rglob("gpio-sim.ko*")):
        build_gpio_sim(release, tree, modules)
    shutil.rmtree(tree)


def build_gpio_sim(release, tree, modules):
    # gpio-sim needs simulated interrupts, which are a part of other kernels and no module: a module
    # finds an interrupt by its number only.
    folder = (tree / GPIO_SIM_SOURCE).parent
    (tree / GPIO_SIM_SOURCE).rename(folder / "gpio-sim-lines.c")
    interrupts = (tree / IRQ_SIM_SOURCE).read_text()
    (folder / "irq-sim.c").write_text(
        interrupts.replace("handle_simple_irq(irq_to_desc(irqnum))", "generic_handle_irq(irqnum)"))
    (folder / "Kbuild").write_text("obj-m := gpio-sim.o\ngpio-sim-y := gpio-sim-lines.o irq-sim.o\n")
    build_module(release, folder, modules, "gpio-sim")


def boot_modules(release):
    """Returns the files of BOOT_MODULES and their dependencies, in loading order."""
    ordered = []
    for module in BOOT_MODULES:
        listing = run(["modprobe", "-d", OUTPUT / "kernel", "-S", release, "--show-depends", module],
                      "run scripts/packages vm")
        for line in listing.splitlines():
            verb, _, rest = line.partition(" ")
            path = pathlib.Path(rest.split()[0]) if verb == "insmod" else None
            if path and path not in ordered:
                ordered.append(path)
    return ordered


def make_initramfs(release):
    say("making the initramfs")
    root = OUTPUT / "initramfs"
    for folder in ["bin", "modules", "dev", "proc", "sys", "run", "tmp"]:
        (root / folder).mkdir(parents=True)
    shutil.copy(BUSYBOX, root / "bin" / "busybox")
    shutil.copy(HERE / "guest_init", root / "init")
    (root / "init").chmod(0o755)
    modules = boot_modules(release)
    for module in modules:
        if module.suffix == ".xz":  # which busybox's insmod does not read
            (root / "modules" / module.stem).write_bytes(lzma.decompress(module.read_bytes()))
        else:
            shutil.copy(module, root / "modules")
    (root / "modules" / "order").write_text(
        "".join(f"{module.name.removesuffix('.xz')}\n" for module in modules))
    names = "\0".join(sorted(str(path.relative_to(root)) for path in root.rglob("*")))
    with open(OUTPUT / "initramfs.cpio", "wb") as archive:
        done = subprocess.run(["cpio", "-o", "-0", "-H", "newc", "--quiet", "-R", "0:0"], cwd=root,
                              input=names.encode(), stdout=archive, timeout=60)
    if done.returncode != 0:
        raise Unprepared("cpio could not write the initramfs; is there room on the disk?")
    shutil.rmtree(root)


def check_tools(needed):
    """needed: the package of each tool."""
    path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    os.environ["PATH"] = path
    missing = {package for tool, package in needed.items() if not shutil.which(tool)}
    if "cpio" in needed and (not BUSYBOX.exists() or b"/lib64/ld-linux" in BUSYBOX.read_bytes()):
        missing.add("busybox-static")
    if missing:
        raise Unprepared(f"not installed: {', '.join(sorted(missing))}; run scripts/packages vm")


def digest_of(*parts):
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part if isinstance(part, bytes) else part.encode())
        digest.update(b"\0")
    return digest.hexdigest()


def up_to_date(name, wanted):
    """Returns true if the part called name was made from the current inputs."""
    stamp = OUTPUT / f"{name}.stamp"
    return stamp.exists() and stamp.read_text() == wanted


def make_kernel(release):
    shutil.rmtree(OUTPUT, ignore_errors=True)
    OUTPUT.mkdir(parents=True)
    fetch_kernel(release)
    unpack_kernel(release)
    modules = OUTPUT / "kernel" / "lib" / "modules" / release
    build_modules(release, modules)
    run(["depmod", "-b", OUTPUT / "kernel", release], "run scripts/packages vm")
    (OUTPUT / "release").write_text(release)


@contextlib.contextmanager
def one_at_a_time():
    """Lets only one test run of a tree prepare it; a second run waits."""
    OUTPUT.parent.mkdir(parents=True, exist_ok=True)
    with open(OUTPUT.with_suffix(".lock"), "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def prepare(force=False):
    """Makes OUTPUT complete and returns it; raises Unprepared with a remedy."""
    check_tools({"cpio": "cpio", "depmod": "kmod", "modprobe": "kmod", "make": "make", "zstd": "zstd",
                 "dpkg-deb": "dpkg", "apt-get": "apt"})
    release = kernel_release()
    kernel = digest_of(release, package_version(f"linux-headers-{release}"), str(LAYOUT))
    initramfs = digest_of(kernel, (HERE / "guest_init").read_bytes(), *BOOT_MODULES)
    with one_at_a_time():
        if force or not up_to_date("kernel", kernel):
            make_kernel(release)
            (OUTPUT / "kernel.stamp").write_text(kernel)
            say(f"{OUTPUT} has kernel {release}")
        if not up_to_date("initramfs", initramfs):
            make_initramfs(release)
            (OUTPUT / "initramfs.stamp").write_text(initramfs)
    return OUTPUT


def own_suite():
    """Returns the name of this machine's Debian, for example bookworm."""
    return platform.freedesktop_os_release().get("VERSION_CODENAME", "")


def prepare_other(suite):
    """Prepares the kernel of another Debian in its root and returns the folder."""
    root = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache")
    say(f"preparing the kernel of {suite}, in a root that is made first if there is none: minutes")
    with one_at_a_time():
        run([HERE.parents[1] / "scripts" / "in-debian", suite, "sh", "-c",
             "scripts/packages kernel && tests/vm/prepare"], f"is there a Debian called {suite}?", minutes=60)
    return root / "lenticule" / f"debian-{suite}" / "src" / "build" / "vm"


def files_of(kernel=None):
    """Returns the folder with the files of a kernel, made if needed. kernel: a suite of Debian or a key
    of SUITES; none is this machine's own."""
    check_tools({"qemu-system-x86_64": "qemu-system-x86"})
    suite = SUITES.get(kernel, kernel)
    return prepare() if suite in (None, own_suite()) else prepare_other(suite)


def release_of(files):
    """Returns the release of a folder's kernel, for example 6.12.94+deb13-amd64."""
    return (files / "release").read_text()


def series_of(files):
    """Returns the kernel's series, for example (6, 12)."""
    return tuple(int(part) for part in release_of(files).split(".")[:2])
