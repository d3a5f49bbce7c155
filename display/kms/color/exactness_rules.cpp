// SPDX-License-Identifier: Apache-2.0
#include "display/kms/color/exactness_rules.h"

#include <algorithm>

namespace lenticule::display {
namespace {

using enum PathKind;

constexpr const char* kRgb565 = "24-bit colours are cut to 16 bits (RGB565)";
constexpr const char* kCirrus =
    "24-bit colours are cut to 16 bits (RGB565) unless lines are short enough for 24";
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
    DriverPath{"xe", AsItIs, "the display engine scans XRGB8888 out of memory",
               "i915/display/skl_universal_plane.c of Linux 6.8, which xe shares",
               "the display engine scans XRGB2101010 out of memory"},

    DriverPath{"cirrus", Alters, kCirrus, "tiny/cirrus.c, cirrus_fb_blit_rect()"},
    DriverPath{"cirrus-qemu", Alters, kCirrus,
               "tiny/cirrus-qemu.c of Linux 6.14, the driver cirrus by its new name"},
    DriverPath{"simpledrm", Alters, kFirmware,
               "tiny/simpledrm.c, simpledrm_primary_plane_helper_atomic_update()"},
    DriverPath{"ofdrm", Alters, kFirmware,
               "tiny/ofdrm.c of Linux 6.2, ofdrm_primary_plane_helper_atomic_update()"},
    DriverPath{"corebootdrm", Alters, kFirmware, "sysfb/corebootdrm.c of Linux 7.2"},
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
    DriverPath{"pixpaper", Alters, "colours become black, white, yellow and red",
               "tiny/pixpaper.c of Linux 7.2, pack_pixels_to_byte()"},
    DriverPath{"repaper", Alters, "colours become black and white",
               "tiny/repaper.c, repaper_fb_dirty()"},
    DriverPath{"ssd130x", Alters, "colours become black and white",
               "solomon/ssd130x.c, ssd130x_fb_blit_rect()"},
    DriverPath{"sitronix_st7920", Alters, "colours become black and white",
               "sitronix/st7920.c of Linux 7.2, st7920_fb_blit_rect()"},
    DriverPath{"st7571", Alters, "colours become at most 4 shades of grey",
               "sitronix/st7571.c of Linux 7.2, st7571_prepare_buffer_grayscale()"},
    DriverPath{"sharp_memory_display", Alters, "colours become black and white",
               "tiny/sharp-memory.c of Linux 6.13, sharp_memory_set_tx_buffer_data()"},
};

using enum KmsObject;
using enum Neutral;
using enum Harm;

constexpr const char* kScaled = "the picture is scaled";
constexpr const char* kDithered = "noise is added to the low bits";
constexpr const char* kToned = "values are mapped to other values";
constexpr const char* kMixed = "the three colours are mixed with each other";
constexpr const char* kEncoded = "RGB is converted to another encoding and back";
constexpr const char* kCable = "use DisplayPort, or an EDID that offers RGB only";
constexpr const char* kDriver = "use another graphics card or driver";
constexpr const char* kMenu = "switch it off in the panel's menu";

using Names = decltype(ExactnessRule::names);

// These functions return rules for properties of which every other value changes subpixels.

constexpr ExactnessRule number(KmsObject object, const char* property, uint64_t value,
                               const char* effect, const char* remedy = kDriver) {
  return {object, property, Number, value, {}, Pixels, effect, remedy};
}

constexpr ExactnessRule named(KmsObject object, const char* property, Names names,
                              const char* effect, const char* remedy = kDriver) {
  return {object, property, Named, 0, names, Pixels, effect, remedy};
}

constexpr ExactnessRule of_kind(Neutral neutral, KmsObject object, const char* property,
                                const char* effect, Names names = {},
                                const char* remedy = kDriver) {
  return {object, property, neutral, 0, names, Pixels, effect, remedy};
}

/// Returns the rule for a property that only makes the panel process the picture.
constexpr ExactnessRule processing(ExactnessRule rule) {
  rule.harm = Processing;
  return rule;
}

// Names are spelled as in the kernel; several spellings belong to several drivers. "max bpc" is the
// depth of the frames: a larger value lets drivers choose other encodings to reach it.
constexpr std::array kRules = {
    processing(
        of_kind(Depth, Connector, "max bpc", "the link may use another encoding, or fewer bits")),
    named(Connector, "Broadcast RGB", {"Full"}, "values are squeezed into 16..235", kCable),
    // Names in Rockchip's kernels and in drivers derived from its HDMI driver.
    named(Connector, "hdmi_output_format", {"output_rgb", "rgb", "RGB", "rgb888"}, kEncoded,
          kCable),
    named(Connector, "hdmi_quant_range", {"full"}, "values are squeezed into 16..235", kCable),
    processing(of_kind(Depth, Connector, "hdmi_output_depth",
                       "the link may use another encoding, or fewer bits", {"24bit", "30bit"})),
    named(Connector, "Colorspace", {"Default"}, kToned),
    number(Connector, "HDR_OUTPUT_METADATA", 0, kToned),
    processing(named(Connector, "content type", {"Graphics"},
                     "a television may sharpen and overscan", kMenu)),
    // Television settings, which Rockchip's kernels have on every connector; 50 is neutral.
    of_kind(Centre, Connector, "brightness", kToned),
    of_kind(Centre, Connector, "contrast", kToned),
    of_kind(Centre, Connector, "saturation", kMixed),
    of_kind(Centre, Connector, "hue", kMixed),
    of_kind(Kept, Connector, "sharpness", "edges are sharpened"),
    number(Connector, "flicker reduction", 0, "lines are mixed"),
    number(Connector, "overscan", 0, kScaled),
    named(Connector, "underscan", {"off"}, kScaled),
    number(Connector, "underscan hborder", 0, kScaled),
    number(Connector, "underscan vborder", 0, kScaled),
    number(Connector, "left margin", 0, kScaled),
    number(Connector, "right margin", 0, kScaled),
    number(Connector, "top margin", 0, kScaled),
    number(Connector, "bottom margin", 0, kScaled),
    // No effect at the panel's native mode, the only one that is used.
    processing(named(Connector, "scaling mode", {"None"}, kScaled)),
    named(Connector, "dither", {"off"}, kDithered),
    named(Connector, "dithering mode", {"off"}, kDithered),
    processing(named(Connector, "dithering depth", {"off", "8 bpc"}, kDithered)),
    number(Connector, "abm level", 0, "brightness changes with the picture",
           "boot with amdgpu.abmlevel=0"),
    named(Connector, "adaptive backlight modulation", {"off"},
          "brightness changes with the picture", "boot with amdgpu.abmlevel=0"),
    // nouveau: saturation is (value - 100) / 50, so that 150 is one and 100 is grey.
    number(Connector, "color vibrance", 150, kMixed),
    number(Connector, "vibrant hue", 90, kMixed),
    processing(named(Connector, "Content Protection", {"Undesired"},
                     "the link may go dark to agree on keys")),
    named(Connector, "Output format", {"RGB", "rgb"}, kEncoded, kCable),
    named(Connector, "output_color_format", {"output_rgb", "RGB", "rgb"}, kEncoded, kCable),
    named(Connector, "color_format", {"rgb", "RGB"}, kEncoded, kCable),
    named(Connector, "color format", {"RGB", "rgb", "RGB 4:4:4"}, kEncoded, kCable),
    processing(of_kind(Kept, Connector, "panel orientation",
                       "the panel is built in turned, which changes no subpixel", {"Normal"},
                       "use a rig whose panel.mounting says how the viewer sees the panel")),
    of_kind(Kept, Connector, "privacy-screen hw-state", "a filter narrows the view",
            {"Disabled", "Disabled-locked"}, "switch the privacy screen off"),

    number(Crtc, "GAMMA_LUT", 0, kToned),
    number(Crtc, "DEGAMMA_LUT", 0, kToned),
    number(Crtc, "CTM", 0, kMixed),
    named(Crtc, "AMD_CRTC_REGAMMA_TF", {"Default"}, kToned),
    processing(number(
        Crtc, "VRR_ENABLED", 0,
        "vblanks follow the frames at no fixed rate, and brightness flickers with them", kMenu)),
    processing(named(Crtc, "SCALING_FILTER", {"Default"}, kScaled)),
    number(Crtc, "SHARPNESS_STRENGTH", 0, "edges are sharpened"),

    named(Plane, "rotation", {"rotate-0"}, "the picture is rotated"),
    of_kind(Maximum, Plane, "alpha", "the picture is dimmed"),
    // All blend modes are equal for a format without alpha.
    processing(named(Plane, "pixel blend mode", {"None", "Pre-multiplied"},
                     "the frame's alpha would take effect")),
    of_kind(Centre, Plane, "brightness", kToned),
    of_kind(Centre, Plane, "contrast", kToned),
    of_kind(Centre, Plane, "saturation", kMixed),
    of_kind(Centre, Plane, "hue", kMixed),
    processing(named(Plane, "SCALING_FILTER", {"Default"}, kScaled)),
    named(Plane, "COLOR_PIPELINE", {"Bypass"}, kToned),
    named(Plane, "AMD_PLANE_DEGAMMA_TF", {"Default"}, kToned),
    number(Plane, "AMD_PLANE_DEGAMMA_LUT", 0, kToned),
    number(Plane, "AMD_PLANE_CTM", 0, kMixed),
    number(Plane, "AMD_PLANE_HDR_MULT", uint64_t{1} << 32, "brightness is multiplied"),
    named(Plane, "AMD_PLANE_SHAPER_TF", {"Default"}, kToned),
    number(Plane, "AMD_PLANE_SHAPER_LUT", 0, kToned),
    number(Plane, "AMD_PLANE_LUT3D", 0, kToned),
    named(Plane, "AMD_PLANE_BLEND_TF", {"Default"}, kToned),
    number(Plane, "AMD_PLANE_BLEND_LUT", 0, kToned),
};

std::optional<uint64_t> first_named(const ExactnessRule& rule, const Property& property) {
  for (const char* const name : rule.names)
    if (name != nullptr)
      if (const auto value = property.value_named(name)) return value;
  return std::nullopt;
}

uint64_t within(const Property& property, uint64_t number) {
  return property.is_range() && property.minimum <= property.maximum
             ? std::clamp(number, property.minimum, property.maximum)
             : number;
}

std::optional<uint64_t> depth_value(const ExactnessRule& rule, const Property& property,
                                    ScanoutDepth depth) {
  if (rule.names[0] == nullptr) return within(property, static_cast<uint64_t>(bits_of(depth)));
  return property.value_named(rule.names[depth == ScanoutDepth::Bits10 ? 1 : 0]);
}

}  // namespace

std::span<const DriverPath> driver_paths() { return kPaths; }

const DriverPath* find_driver_path(std::string_view driver) {
  const auto found = std::find_if(kPaths.begin(), kPaths.end(),
                                  [&](const DriverPath& path) { return path.driver == driver; });
  return found == kPaths.end() ? nullptr : &*found;
}

const char* object_name(KmsObject object) {
  constexpr const char* kNames[] = {"connector", "crtc", "plane"};
  return kNames[static_cast<size_t>(object)];
}

std::span<const ExactnessRule> exactness_rules() { return kRules; }

std::optional<uint64_t> neutral_value(const ExactnessRule& rule, const Property& property,
                                      ScanoutDepth depth) {
  switch (rule.neutral) {
    case Number:
      return within(property, rule.number);
    case Depth:
      return depth_value(rule, property, depth);
    case Named:
    case Kept:
      return first_named(rule, property);
    case Maximum:
      return property.maximum;
    case Centre:
      if (property.is_range() && property.minimum == 0 && property.maximum == 100) return 50;
      return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace lenticule::display
