// SPDX-License-Identifier: Apache-2.0
#include "display/kms/color/driver_paths.h"

#include <algorithm>
#include <array>

namespace lenticule::display {
namespace {

using enum PathKind;

constexpr const char* kRgb565 = "24-bit colours are cut to 16 bits (RGB565)";
constexpr const char* kMipi = "drm_mipi_dbi.c, mipi_dbi_buf_copy()";
constexpr const char* kFirmware =
    "frames are converted to the format, size and scaling that the firmware set";

// Files are in drivers/gpu/drm of Linux 6.1, unless another version is named.
constexpr std::array kPaths = {
    // Virtual machines, whose host receives the buffer's bytes.
    DriverPath{"virtio_gpu", AsItIs, "the host gets the buffer's pixels unchanged",
               "virtio/virtgpu_plane.c, virtio_gpu_update_dumb_bo()"},
    DriverPath{"bochs-drm", AsItIs, "the host scans the buffer out of video memory",
               "tiny/bochs.c, bochs_plane_update()"},
    DriverPath{"vkms", AsItIs, "8 bits become 16 by a factor of 257, and 8 again by dividing",
               "vkms/vkms_formats.c, XRGB8888_to_argb_u16() and argb_u16_to_XRGB8888()"},
    // Display engines that scan out the buffer; their debugfs files describe the rest of the path.
    DriverPath{"i915", AsItIs, "the display engine scans XRGB8888 out of memory",
               "i915/display/skl_universal_plane.c, skl_plane_ctl_format()",
               "the display engine scans XRGB2101010 out of memory"},

    DriverPath{"cirrus", Alters,
               "24-bit colours are cut to 16 bits (RGB565) unless lines are short enough for 24",
               "tiny/cirrus.c, cirrus_fb_blit_rect()"},
    DriverPath{"cirrus-qemu", Alters, "24-bit colours are cut to 16 bits (RGB565)",
               "tiny/cirrus-qemu.c of Linux 6.14, the driver cirrus by its new name"},
    DriverPath{"simpledrm", Alters, kFirmware,
               "tiny/simpledrm.c, simpledrm_primary_plane_helper_atomic_update()"},
    DriverPath{"ofdrm", Alters, kFirmware,
               "tiny/ofdrm.c of Linux 6.2, ofdrm_primary_plane_helper_atomic_update()"},
    DriverPath{"efidrm", Alters, kFirmware, "sysfb/efidrm.c of Linux 6.16"},
    DriverPath{"vesadrm", Alters, kFirmware, "sysfb/vesadrm.c of Linux 6.16"},
    DriverPath{
        "gm12u320", Alters,
        "a USB projector gets copies at its own rate, and parts of old frames when it is busy",
        "tiny/gm12u320.c, gm12u320_copy_fb_to_blocks()"},
    DriverPath{"udl", Alters, kRgb565, "udl/udl_transfer.c, pixel32_to_be16()"},
    DriverPath{"evdi", Alters, "the USB adapter compresses pictures",
               "statement of DisplayLink; the driver is not part of the kernel"},
    DriverPath{"gud", Alters, "the USB adapter's own format may have fewer bits",
               "gud/gud_pipe.c, gud_prep_flush()"},
    DriverPath{"vmwgfx", Alters, "the driver may keep showing an old frame",
               "reports of programs that flip; vmwgfx/vmwgfx_stdu.c"},
    // SPI panels.
    DriverPath{"hx8357d", Alters, kRgb565, kMipi},
    DriverPath{"ili9163", Alters, kRgb565, kMipi},
    DriverPath{"ili9225", Alters, kRgb565, "tiny/ili9225.c, ili9225_fb_dirty()"},
    DriverPath{"ili9341", Alters, kRgb565, kMipi},
    DriverPath{"ili9486", Alters, kRgb565, kMipi},
    DriverPath{"mi0283qt", Alters, kRgb565, kMipi},
    DriverPath{"panel-mipi-dbi", Alters, kRgb565, kMipi},
    DriverPath{"st7735r", Alters, kRgb565, kMipi},
    DriverPath{"st7586", Alters, "colours become 4 shades of grey",
               "tiny/st7586.c, st7586_xrgb8888_to_gray332()"},
    DriverPath{"repaper", Alters, "colours become black and white",
               "tiny/repaper.c, repaper_fb_dirty()"},
    DriverPath{"ssd130x", Alters, "colours become black and white",
               "solomon/ssd130x.c, ssd130x_fb_blit_rect()"},
    DriverPath{"sharp_memory_display", Alters, "colours become black and white",
               "tiny/sharp-memory.c of Linux 6.13, sharp_memory_set_tx_buffer_data()"},
};

}  // namespace

std::span<const DriverPath> driver_paths() {
  return kPaths;
}

const DriverPath* find_driver_path(std::string_view driver) {
  const auto found = std::find_if(kPaths.begin(), kPaths.end(),
                                  [&](const DriverPath& path) { return path.driver == driver; });
  return found == kPaths.end() ? nullptr : &*found;
}

}  // namespace lenticule::display
