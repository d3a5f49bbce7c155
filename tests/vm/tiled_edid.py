# SPDX-License-Identifier: Apache-2.0
"""Makes the EDID of one tile of a panel with several connectors.

A base block with one detailed timing, and a DisplayID 1.2 extension with a tiled display topology
block, from which the kernel makes the connector's property TILE. set_edids() gives EDIDs to a guest.
"""

PRODUCT, TIMING_1, TILED_DISPLAY = 0x00, 0x03, 0x12
STANDALONE = 3
SINGLE_ENCLOSURE = 0x80


PANEL = b"LGD" + (0x1234).to_bytes(2, "little") + (1).to_bytes(4, "little")


def with_checksum(data):
    """Returns the bytes and the one that makes their sum a multiple of 256."""
    return data + bytes([-sum(data) % 256])


# Horizontal and vertical blanking; front porch and sync pulse are parts of it.
H_BLANK, H_FRONT, H_SYNC = 160, 48, 32
V_BLANK, V_FRONT, V_SYNC = 32, 3, 6


def clock_10khz(width, height, hertz=60):
    return (width + H_BLANK) * (height + V_BLANK) * hertz // 10_000


def detailed_timing(width, height):
    clock = clock_10khz(width, height)
    return bytes([
        clock & 255, clock >> 8,
        width & 255, H_BLANK & 255, width >> 8 << 4 | H_BLANK >> 8,
        height & 255, V_BLANK & 255, height >> 8 << 4 | V_BLANK >> 8,
        H_FRONT, H_SYNC, V_FRONT << 4 | V_SYNC, 0,
        300 & 255, 225 & 255, 300 >> 8 << 4 | 225 >> 8, 0, 0, 0x1A])


def product_block():
    return bytes([PRODUCT, 0, 12]) + PANEL + bytes([1, 20, 0])  # week 1 of 2020, no text


def timing_block(width, height):
    """All numbers are stored less one."""
    preferred_4_3, positive = 0x82, 0x8000
    numbers = [width, H_BLANK, H_FRONT | positive, H_SYNC, height, V_BLANK, V_FRONT, V_SYNC]
    clock = (clock_10khz(width, height) - 1).to_bytes(3, "little")
    return bytes([TIMING_1, 0, 20]) + clock + bytes([preferred_4_3]) + b"".join(
        (number - 1).to_bytes(2, "little") for number in numbers)


def base_block(width, height):
    name = b"\x00\x00\x00\xfc\x00" + b"Tiled\n".ljust(13)
    dummy = b"\x00\x00\x00\x10\x00" + bytes(13)
    header = b"\x00\xff\xff\xff\xff\xff\xff\x00"
    identity = b"\x30\xe4\x34\x12\x01\x00\x00\x00\x01\x1e"  # LGD, product 0x1234, serial 1
    picture = bytes([1, 4, 0xA5, 30, 22, 120, 6])  # EDID 1.4, DisplayPort with 8 bits, RGB
    colours = b"\xee\x91\xa3\x54\x4c\x99\x26\x0f\x50\x54"
    timings = bytes(3) + b"\x01" * 16
    block = header + identity + picture + colours + timings + detailed_timing(width, height)
    return with_checksum(block + name + dummy + dummy + bytes([1]))


def tiled_block(columns, rows, column, row, width, height):
    """Sizes and numbers are stored less one; places are not."""
    across, down = columns - 1, rows - 1
    topology = bytes([(across & 15) << 4 | down & 15, (column & 15) << 4 | row & 15,
                      across >> 4 << 6 | down >> 4 << 4 | column >> 4 << 2 | row >> 4])
    size = (width - 1).to_bytes(2, "little") + (height - 1).to_bytes(2, "little")
    bezel = bytes(5)
    payload = bytes([SINGLE_ENCLOSURE]) + topology + size + bezel + PANEL
    return bytes([TILED_DISPLAY, 0, len(payload)]) + payload


def tile_edid(columns, rows, column, row, width, height):
    """Returns the EDID of one tile; width and height are those of the tile."""
    blocks = (product_block() + timing_block(width, height)
              + tiled_block(columns, rows, column, row, width, height))
    section = with_checksum(bytes([0x12, len(blocks), STANDALONE, 0]) + blocks)
    extension = with_checksum((b"\x70" + section).ljust(127, b"\x00"))
    return base_block(width, height) + extension

# Argument of the kernel with which QEMU's second output is connected from the start: a newer kernel drops the
# EDID of an output that is not.
SECOND_OUTPUT = "video=Virtual-2:e"


def set_edids(vm, edids):
    """Makes the guest's virtio-gpu read these EDIDs, one per output, and connects all outputs."""
    names = [f"Virtual-{number + 1}:edid/{number}.bin" for number in range(len(edids))]
    vm.check(["mkdir", "-p", "/lib/firmware/edid"])
    for number, edid in enumerate(edids):
        vm.write_file(f"/lib/firmware/edid/{number}.bin", edid)
    vm.write_file("/sys/module/drm/parameters/edid_firmware", ",".join(names) + "\n")
    # A newer kernel keeps the EDIDs that it read when the driver found the device.
    driver = "/sys/bus/virtio/drivers/virtio_gpu"
    vm.check(f"cd {driver} && device=$(echo virtio*) && echo $device > unbind && echo $device > bind")
    vm.wait_for_path("/dev/dri/card0")
    for number in range(vm.machine.outputs):
        vm.write_file(f"/sys/class/drm/card0-Virtual-{number + 1}/status", "on")
