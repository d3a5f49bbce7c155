// SPDX-License-Identifier: Apache-2.0
// ExactnessAudit finds the properties that change pixels, lists the values to write, and checks the
// result. Facts about an output that are not properties come from sysfs, readable by every user,
// and from debugfs, readable by root.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/color/exactness_rules.h"
#include "display/kms/device/connector.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/kms/probe/output_choice.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

// LegacyGamma sets the gamma ramp of drivers that support atomic commits and have no GAMMA_LUT
// property. Such a ramp has its own system call, and a ramp left by a night-light program would
// change every value.

/// Name of the row of the report.
inline constexpr const char* kGammaRampRow = "gamma ramp";

struct GammaRamp {
  std::vector<uint16_t> red, green, blue;  ///< equal lengths; 65535 is full intensity

  friend bool operator==(const GammaRamp&, const GammaRamp&) = default;
};

/// Returns the left-aligned bits of the index, as the kernel fills a new ramp: correct both for
/// hardware that truncates the low bits and for hardware that rounds. Other lengths are stretched
/// over the range.
inline uint16_t linear_value(size_t index, size_t entries) {
  const bool stretched = !std::has_single_bit(entries);
  return static_cast<uint16_t>(stretched ? index * 65535 / (entries - 1) : index * 65536 / entries);
}

/// Returns the ramp that maps every 8-bit value to itself.
[[nodiscard]] inline GammaRamp linear_ramp(size_t entries) {
  std::vector<uint16_t> values(entries);
  for (size_t i = 0; i < entries; ++i) values[i] = linear_value(i, entries);
  return {values, values, values};
}

/// Handles the ramp of one CRTC. Functions that return int return 0 or a negative errno. Thread
/// safety: one thread.
class LegacyGamma {
 public:
  /// Reads the current ramp. If look-up tables are properties or the CRTC has no ramp, all
  /// functions of this class do nothing.
  LegacyGamma(int fd, const PropertyTable& crtc)
      : fd_(fd), crtc_(crtc.object()), linear_(linear_ramp(entries_of(fd, crtc))) {
    if (present()) found_ = read();
  }

  int make_linear() const noexcept {
    // A ramp that could not be read could not be restored, so it is not changed.
    return present() && found_ ? write(linear_) : 0;
  }
  /// Writes the ramp that was found at the start.
  int restore() const noexcept {
    return present() && found_ && *found_ != linear_ ? write(*found_) : 0;
  }

  /// Returns the row of the report; none if there is no ramp. `committed` is false if the ramp is
  /// only checked and not written.
  [[nodiscard]] std::optional<AuditRow> row(bool committed) const {
    if (!present()) return std::nullopt;
    const auto text_of = [&](const std::optional<GammaRamp>& ramp) {
      return !ramp ? "unreadable" : *ramp == linear_ ? "linear" : "set";
    };
    const std::optional<GammaRamp> now = read();
    AuditRow row{.object = object_name(KmsObject::Crtc),
                 .property = kGammaRampRow,
                 .found = text_of(found_),
                 .wanted = "linear",
                 .now = text_of(now),
                 .alters_pixels = true,
                 .effect = "values are mapped to other values",
                 .remedy = "switch night lights and colour profiles off"};
    if (!found_ || !now)
      row.outcome = AuditOutcome::Foreign;
    else if (*now == linear_)
      row.outcome = *found_ == linear_ ? AuditOutcome::Neutral : AuditOutcome::Forced;
    else
      row.outcome = committed ? AuditOutcome::Refused : AuditOutcome::Planned;
    return row;
  }

 private:
  static constexpr int kMostEntries = 65536;

  static size_t entries_of(int fd, const PropertyTable& crtc) {
    // If either property exists, the kernel makes the ramp an alias of it, and the audit resets the
    // property.
    if (crtc.find("GAMMA_LUT") != nullptr || crtc.find("DEGAMMA_LUT") != nullptr) return 0;
    const DrmCrtc source(drmModeGetCrtc(fd, crtc.object()));
    if (!source || source->gamma_size < 2 || source->gamma_size > kMostEntries) return 0;
    return static_cast<size_t>(source->gamma_size);
  }
  [[nodiscard]] bool present() const { return !linear_.red.empty(); }
  [[nodiscard]] std::optional<GammaRamp> read() const {
    GammaRamp ramp = linear_;
    const auto entries = static_cast<uint32_t>(ramp.red.size());
    if (drmModeCrtcGetGamma(fd_, crtc_, entries, ramp.red.data(), ramp.green.data(),
                            ramp.blue.data()) != 0)
      return std::nullopt;
    return ramp;
  }
  int write(const GammaRamp& ramp) const noexcept {
    // libdrm only reads the values; later versions declare them const.
    const auto values = [](const std::vector<uint16_t>& of) {
      return const_cast<uint16_t*>(of.data());
    };
    return drmModeCrtcSetGamma(fd_, crtc_, static_cast<uint32_t>(ramp.red.size()), values(ramp.red),
                               values(ramp.green), values(ramp.blue));
  }

  int fd_;
  uint32_t crtc_;
  GammaRamp linear_;                ///< empty: there is no ramp
  std::optional<GammaRamp> found_;  ///< none if the ramp could not be read
};

/// Names of rows that other code looks up.
inline constexpr const char* kDepthRow = "depth and dithering";
inline constexpr const char* kCompressionRow = "DSC";

inline constexpr const char* kLateRemedy =
    "boot with i915.enable_psr=0 or amdgpu.dcdebugmask=0x10 if vblanks are missed";

/// A file that contains one value.
struct LinkFile {
  const char* row;
  /// {0}: the card's name, {1}: its number, {2}: the connector's name, {3}: the CRTC's number
  const char* path;
  const char* before;  ///< the value follows this text and ends with its line
  const char* wanted;
  bool alters_pixels;
  const char* effect;
  const char* remedy;
  bool by_crtc = false;  ///< each CRTC has a section that begins with "[CRTC:42:pipe A]:"
};

inline constexpr const char* kSlowRemedy =
    "set the driver to one refresh rate (i915: drrs in its debug files)";
inline constexpr const char* kSlow = "the refresh rate drops while the picture does not change";

inline constexpr LinkFile kSysfs[] = {
    {"panel_power_savings", "/sys/class/drm/{0}-{2}/amdgpu/panel_power_savings", "", "0", true,
     "brightness changes with the picture",
     "write 0 to amdgpu/panel_power_savings of the connector in /sys/class/drm, and keep "
     "power-profiles-daemon and tuned from raising it"},
};

inline constexpr LinkFile kDebugfs[] = {
    // i915/display/intel_display_debugfs.c, i915_dsc_fec_support_show()
    {kCompressionRow, "/sys/kernel/debug/dri/{1}/{2}/i915_dsc_fec_support", "DSC_Enabled: ", "no",
     true, "the link compresses the picture",
     "use a lower refresh rate, or a link with more lanes"},
    // amd/display/amdgpu_dm/amdgpu_dm_debugfs.c, dp_dsc_clock_en_read()
    {kCompressionRow, "/sys/kernel/debug/dri/{1}/{2}/dsc_clock_en", "", "0", true,
     "the link compresses the picture", "use a lower refresh rate, or a link with more lanes"},
    // force_yuv420_output_get(), same file
    {"force_yuv420_output", "/sys/kernel/debug/dri/{1}/{2}/force_yuv420_output", "", "0", true,
     "RGB is converted to another encoding and back", "write 0 to that file of debugfs"},
    // intel_psr_status(), same file as for DSC; it reports Panel Replay too
    {"PSR", "/sys/kernel/debug/dri/{1}/{2}/i915_psr_status", "PSR mode: ", "disabled", false,
     "the panel refreshes itself, and a picture may be a vblank late", kLateRemedy},
    // psr_get(), same file as for force_yuv420_output
    {"PSR", "/sys/kernel/debug/dri/{1}/{2}/psr_state", "", "0", false,
     "the panel refreshes itself, and a picture may be a vblank late", kLateRemedy},
    // i915_drrs_status(), same file, of Linux 6.1; intel_drrs.c of 6.12
    {"DRRS", "/sys/kernel/debug/dri/{1}/i915_drrs_status", "DRRS Enabled: ", "no", false, kSlow,
     kSlowRemedy, true},
    {"DRRS", "/sys/kernel/debug/dri/{1}/crtc-{3}/i915_drrs_status", "DRRS enabled: ", "no", false,
     kSlow, kSlowRemedy},
};

/// Returns "card1" and "1" for "/dev/dri/card1".
inline std::optional<std::pair<std::string, std::string>> card_names(const std::string& path) {
  constexpr std::string_view kPrefix = "/dev/dri/card";
  if (!path.starts_with(kPrefix) || path.size() == kPrefix.size()) return std::nullopt;
  return std::pair{path.substr(kPrefix.size() - 4), path.substr(kPrefix.size())};
}

inline std::string line_after(std::string_view text, std::string_view before) {
  const size_t at = text.find(before);
  if (at == std::string_view::npos) return {};
  std::string_view line = text.substr(at + before.size());
  const auto ends_line = [](char character) { return character == '\n' || character == '\0'; };
  line = line.substr(0, static_cast<size_t>(std::ranges::find_if(line, ends_line) - line.begin()));
  return std::string(line);
}

inline AuditRow row_for(const LinkFile& file, const std::string& value) {
  return {.object = "link",
          .property = file.row,
          .found = value,
          .wanted = file.wanted,
          .now = value,
          .outcome = value == file.wanted ? AuditOutcome::Neutral : AuditOutcome::ReadOnly,
          .alters_pixels = file.alters_pixels,
          .effect = file.effect,
          .remedy = file.remedy};
}

inline std::string_view section_of(std::string_view text, uint32_t crtc) {
  const size_t begin = text.find(fmt::format("[CRTC:{}:", crtc));
  if (begin == std::string_view::npos) return {};
  const size_t end = text.find("\n[C", begin);
  return text.substr(begin, end == std::string_view::npos ? end : end - begin);
}

/// Returns a row for each file that could be read and parsed. `card` is the path of the card's
/// node, /dev/dri/cardN.
inline std::vector<AuditRow> read_files(KmsPlatform& platform, const std::string& card,
                                        const Pipe& pipe, std::span<const LinkFile> files) {
  std::vector<AuditRow> rows;
  const auto names = card_names(card);
  if (!names) return rows;
  for (const LinkFile& file : files) {
    const std::string text =
        platform
            .read_kernel_file(fmt::format(fmt::runtime(file.path), names->first, names->second,
                                          pipe.connector.name, pipe.crtc_number))
            .value_or("");
    const std::string value =
        line_after(file.by_crtc ? section_of(text, pipe.crtc) : text, file.before);
    if (!value.empty()) rows.push_back(row_for(file, value));
  }
  return rows;
}

/// Returns the place of "dither=no, bpp=24", i915/display/intel_display_debugfs.c,
/// intel_crtc_info().
inline LinkFile depth_file(ScanoutDepth depth) {
  const bool deep = depth == ScanoutDepth::Bits10;
  return {kDepthRow,
          "/sys/kernel/debug/dri/{1}/i915_display_info",
          "dither=",
          deep ? "no, bpp=30" : "no, bpp=24",
          true,
          "low bits are cut off or dithered",
          deep ? "use a mode that the link carries with 10 bits per colour, or state panel.bits = "
                 "8 in the rig"
               : "use a mode that the link carries with 8 bits per colour",
          true};
}

/// Returns a row for each debugfs file that could be read and parsed. The driver takes locks to
/// answer, so call it only while no flips are pending.
[[nodiscard]] inline std::vector<AuditRow> read_debugfs_rows(KmsPlatform& platform,
                                                             const std::string& card,
                                                             const Pipe& pipe) {
  std::vector<LinkFile> files(std::begin(kDebugfs), std::end(kDebugfs));
  files.push_back(depth_file(pipe.depth));
  return read_files(platform, card, pipe, files);
}

inline constexpr const char* kOtherOutput = "use an output of a graphics card";

inline bool is_analogue(uint32_t type) {
  return type == DRM_MODE_CONNECTOR_VGA || type == DRM_MODE_CONNECTOR_DVIA ||
         type == DRM_MODE_CONNECTOR_Composite || type == DRM_MODE_CONNECTOR_SVIDEO ||
         type == DRM_MODE_CONNECTOR_Component || type == DRM_MODE_CONNECTOR_TV ||
         type == DRM_MODE_CONNECTOR_9PinDIN;
}

/// Returns true if the row's property has, or will have, its neutral value.
inline bool is_held(const AuditRow& row) {
  return row.outcome == AuditOutcome::Neutral || row.outcome == AuditOutcome::Forced ||
         row.outcome == AuditOutcome::Planned;
}

/// Returns true for links that may carry compressed pictures.
inline bool may_compress(uint32_t type) {
  return type == DRM_MODE_CONNECTOR_DisplayPort || type == DRM_MODE_CONNECTOR_eDP ||
         type == DRM_MODE_CONNECTOR_DSI || type == DRM_MODE_CONNECTOR_USB;
}

inline bool names_encoding(const AuditRow& row) {
  return row.outcome != AuditOutcome::Refused && row.outcome != AuditOutcome::Foreign &&
         row.outcome != AuditOutcome::ReadOnly &&
         (row.property == "Output format" || row.property == "output_color_format" ||
          row.property == "hdmi_output_format" || row.property == "color_format" ||
          row.property == "color format");
}

inline bool forces_full_range(const AuditRow& row) {
  return (row.property == "Broadcast RGB" || row.property == "hdmi_quant_range") &&
         row.now == row.wanted;
}

inline bool is_wrong(const AuditRow& row) {
  return row.outcome == AuditOutcome::Refused || row.outcome == AuditOutcome::ReadOnly;
}

inline void add_remedy(ExactnessReport& report, std::string remedy) {
  if (!remedy.empty() && std::ranges::find(report.remedies, remedy) == report.remedies.end())
    report.remedies.push_back(std::move(remedy));
}

inline void add_wrong(ExactnessReport& report, std::string reason, std::string remedy) {
  report.reasons.push_back(std::move(reason));
  add_remedy(report, std::move(remedy));
}

inline void add_unseen(ExactnessReport& report, std::string what, std::string remedy) {
  report.unseen.push_back(std::move(what));
  add_remedy(report, std::move(remedy));
}

inline void evaluate_row(ExactnessReport& report, const AuditRow& row) {
  const std::string fact =
      fmt::format("{} '{}' is {}: {}", row.object, row.property, row.now, row.effect);
  if (!row.alters_pixels) {
    if (!is_wrong(row)) return;
    report.remarks.push_back(fact);
    return add_remedy(report, row.remedy);
  }
  switch (row.outcome) {
    case AuditOutcome::Neutral:
    case AuditOutcome::Forced:
      return report.verified.push_back(
          fmt::format("{} '{}' is {}", row.object, row.property, row.now));
    case AuditOutcome::Planned:
      return report.verified.push_back(
          fmt::format("{} '{}' would be set to {}", row.object, row.property, row.wanted));
    case AuditOutcome::Refused:
    case AuditOutcome::ReadOnly:
      return add_wrong(report, fact, row.remedy);
    case AuditOutcome::Foreign:
      return add_unseen(report, fact + " unless that value is neutral", row.remedy);
  }
}

template <typename Test>
bool any_row(const ExactnessReport& report, const Test& test) {
  return std::ranges::any_of(report.rows, test);
}

inline void evaluate_driver(ExactnessReport& report, const std::string& driver, const Pipe& pipe) {
  const DriverPath* const path = find_driver_path(driver);
  if (path == nullptr) {
    if (pipe.connector.type == DRM_MODE_CONNECTOR_SPI)
      return add_wrong(report,
                       fmt::format("driver {}: panels on SPI get 16-bit colours (RGB565)", driver),
                       kOtherOutput);
    return add_unseen(
        report,
        fmt::format("driver {}: it is not known whether the driver converts frames", driver), "");
  }
  const std::string fact = fmt::format("driver {}: {}", driver, path->fact);
  if (path->kind == PathKind::Alters) return add_wrong(report, fact, kOtherOutput);
  if (pipe.depth == ScanoutDepth::Bits8) return report.verified.push_back(fact);
  if (path->fact_of_ten_bits != nullptr)
    return report.verified.push_back(fmt::format("driver {}: {}", driver, path->fact_of_ten_bits));
  add_unseen(report,
             fmt::format("driver {}: it is not known whether the driver converts {} frames", driver,
                         format_name(pipe.depth)),
             "");
}

/// States whether frames leave memory with the bits that the rig states.
inline void evaluate_format(ExactnessReport& report, const Pipe& pipe) {
  if (pipe.depth != pipe.wanted)
    return add_wrong(
        report,
        fmt::format("the driver cannot scan out {} bits per colour ({}): the panel gets {}",
                    bits_of(pipe.wanted), format_name(pipe.wanted), bits_of(pipe.depth)),
        "use a card whose driver can, or state panel.bits = 8 in the rig");
  if (pipe.depth == ScanoutDepth::Bits8) return;
  report.verified.push_back(fmt::format("frames are scanned out with {} bits per colour ({})",
                                        bits_of(pipe.depth), format_name(pipe.depth)));
  if (any_row(report, [](const AuditRow& row) { return row.property == kGammaRampRow; }))
    add_unseen(report, "the gamma ramp of the CRTC has an entry for each 8-bit value only",
               "state panel.bits = 8 in the rig");
}

inline void evaluate_placement(ExactnessReport& report, const Pipe& pipe,
                               const PropertyTable& plane) {
  const uint64_t width = pipe.mode.hdisplay;
  const uint64_t height = pipe.mode.vdisplay;
  if (plane.value("SRC_X") == pipe.source_x() && plane.value("SRC_Y") == pipe.source_y() &&
      plane.value("CRTC_X") == 0 && plane.value("CRTC_Y") == 0 &&
      plane.value("SRC_W") == width << 16 && plane.value("SRC_H") == height << 16 &&
      plane.value("CRTC_W") == width && plane.value("CRTC_H") == height)
    report.verified.emplace_back("the plane shows the frame pixel for pixel");
  else
    add_wrong(report, "the plane does not show the frame pixel for pixel", "");
}

inline bool has_link_row(const ExactnessReport& report, std::string_view property) {
  return any_row(report, [&](const AuditRow& row) {
    return row.object == "link" && row.property == property;
  });
}

inline void evaluate_encoding(ExactnessReport& report, const Pipe& pipe) {
  if (any_row(report, names_encoding)) {
    report.verified.emplace_back("the driver is set to send RGB");
    return;
  }
  const EdidReading& edid = pipe.connector.edid;
  if (is_one_of(pipe.mode, edid.only_as_420))
    return add_wrong(report, "the panel accepts this mode as YCbCr 4:2:0 only",
                     "use a lower refresh rate, or use DisplayPort");
  if (edid.identity && !edid.offers_ycbcr) {
    report.verified.emplace_back("the panel accepts RGB only");
    return;
  }
  add_unseen(report,
             edid.identity
                 ? "the panel also accepts YCbCr, and the driver does not report what it sends"
                 : "without a valid EDID it is not known what the link carries",
             "use DisplayPort, or an EDID that offers RGB only (drm.edid_firmware=)");
}

/// States that a panel which can vary its refresh keeps the rate of the mode. A driver that refuses
/// is a remark of evaluate_row().
inline void evaluate_refresh(ExactnessReport& report, const Pipe& pipe) {
  const auto holds = [](const AuditRow& row) {
    return row.property == "VRR_ENABLED" && is_held(row);
  };
  if (pipe.connector.variable_refresh && any_row(report, holds))
    report.verified.emplace_back(
        "the panel could vary its refresh, which is held at the rate of the mode");
}

inline void evaluate_range(ExactnessReport& report, const Pipe& pipe) {
  if (!is_hdmi(pipe.connector.type)) return;
  if (any_row(report, forces_full_range)) {
    report.verified.emplace_back("the driver is set to send the full range of values");
    return;
  }
  add_unseen(report, "the driver cannot be set to send the full range of values",
             "set the panel's input to full range, and use its own mode rather than a television "
             "one");
}

/// Returns the bits per colour that the panel accepts, as its EDID states them. For an HDMI input,
/// more than 8 bits must be stated by the HDMI data block; the base block alone does not suffice.
inline std::optional<int> bits_accepted(const ConnectorInfo& connector) {
  const EdidReading& edid = connector.edid;
  if (!edid.identity || !is_hdmi(connector.type)) return edid.bits_per_colour;
  return edid.deep_colour ? 10 : std::min(edid.bits_per_colour.value_or(8), 8);
}

inline std::optional<uint64_t> most_bits(const PropertyTable& connector) {
  const Property* const limit = connector.find("max bpc");
  if (limit == nullptr || !limit->is_range() || limit->maximum == 0) return std::nullopt;
  return limit->maximum;
}

inline void evaluate_depth(ExactnessReport& report, const Pipe& pipe) {
  const int bits = bits_of(pipe.depth);
  const char* const remedy = bits > 8 ? "state panel.bits = 8 in the rig, or use a panel and a "
                                        "connector of 10 bits per colour"
                                      : "use a panel of 8 bits per colour";
  const std::optional<int> accepted = bits_accepted(pipe.connector);
  if (accepted && *accepted < bits)
    add_wrong(report,
              fmt::format("the panel accepts {} bits per colour: low bits are cut off or dithered",
                          *accepted),
              remedy);
  const std::optional<uint64_t> most = most_bits(pipe.connector.properties);
  if (most && *most < static_cast<uint64_t>(bits))
    add_wrong(report,
              fmt::format("the link carries at most {} bits per colour: low bits are cut off or "
                          "dithered",
                          *most),
              remedy);
  constexpr const char* kLook =
      "run 'lenticule doctor' as root, which can read more of the driver; look at a test card of "
      "single-step ramps";
  if (!has_link_row(report, kDepthRow))
    add_unseen(report, "bits per colour and dithering of the link cannot be read back", kLook);
  if (may_compress(pipe.connector.type) && !has_link_row(report, kCompressionRow))
    add_unseen(report, "whether the link compresses the picture (DSC) cannot be read back", kLook);
}

inline void evaluate_link(ExactnessReport& report, const Pipe& pipe) {
  if (pipe.connector.type == DRM_MODE_CONNECTOR_VIRTUAL) {
    report.verified.emplace_back("a virtual output has no link");
    return;
  }
  if (is_analogue(pipe.connector.type))
    add_wrong(report, "the link is analogue: the panel digitises the values again",
              "use a digital connector");
  evaluate_encoding(report, pipe);
  evaluate_range(report, pipe);
  evaluate_depth(report, pipe);
  const PixelSize size{pipe.mode.hdisplay, pipe.mode.vdisplay};
  const std::vector<PixelSize> native = pipe.connector.edid.native_sizes();
  if (!native.empty() && std::ranges::find(native, size) == native.end())
    add_unseen(report, "the EDID states another native size: a bridge or an adapter may scale",
               "connect the panel without an adapter, or load an EDID with the size that is sent "
               "(drm.edid_firmware=)");
}

/// Returns true if a property that was neutral in `before` is not neutral in `after`.
[[nodiscard]] inline bool lost_a_setting(const ExactnessReport& before,
                                         const ExactnessReport& after) {
  const auto held = [](const AuditRow& row) {
    return row.outcome == AuditOutcome::Neutral || row.outcome == AuditOutcome::Forced;
  };
  return std::ranges::any_of(after.rows, [&](const AuditRow& row) {
    if (row.outcome != AuditOutcome::Refused) return false;
    return std::ranges::any_of(before.rows, [&](const AuditRow& old) {
      return old.object == row.object && old.property == row.property && held(old);
    });
  });
}

struct PipeTables {
  PropertyTable connector;
  PropertyTable crtc;
  PropertyTable plane;

  [[nodiscard]] const PropertyTable& of(KmsObject object) const {
    if (object == KmsObject::Connector) return connector;
    return object == KmsObject::Crtc ? crtc : plane;
  }
  /// Reads the properties; none if one of the objects no longer exists.
  [[nodiscard]] static std::optional<PipeTables> read(int fd, uint32_t connector, uint32_t crtc,
                                                      uint32_t plane) {
    auto connector_table = PropertyTable::read(fd, connector, DRM_MODE_OBJECT_CONNECTOR);
    auto crtc_table = PropertyTable::read(fd, crtc, DRM_MODE_OBJECT_CRTC);
    auto plane_table = PropertyTable::read(fd, plane, DRM_MODE_OBJECT_PLANE);
    if (!connector_table || !crtc_table || !plane_table) return std::nullopt;
    return PipeTables{std::move(*connector_table), std::move(*crtc_table), std::move(*plane_table)};
  }
};

class ExactnessAudit {
 public:
  /// `depth` is that of the frames which are scanned out.
  ExactnessAudit(const PipeTables& found, ScanoutDepth depth) {
    for (const ExactnessRule& rule : exactness_rules()) {
      const PropertyTable& table = found.of(rule.object);
      const Property* property = table.find(rule.property);
      if (property == nullptr) continue;
      const auto wanted = neutral_value(rule, *property, depth);
      const bool settable = wanted && property->writable() && rule.neutral != Neutral::Kept;
      (settable ? items_ : leftovers_)
          .push_back({&rule, *property, table.object(), wanted, settable});
    }
  }

  /// Returns the properties to write at a modeset, except refused ones.
  [[nodiscard]] std::vector<PropertySetting> settings() const {
    std::vector<PropertySetting> settings;
    for (const Item& item : items_)
      if (!item.refused) settings.push_back({item.object, item.found.id, *item.wanted});
    return settings;
  }
  /// Marks a setting as refused or not, in order to find out which ones a driver rejects.
  void set_refused(size_t index, bool refused) { items_.at(index).refused = refused; }
  [[nodiscard]] size_t count() const { return items_.size(); }

  /// Returns the report. `now` holds the properties read after the commit; none if there was no
  /// commit (`doctor`). `further` are rows about facts that are not properties.
  [[nodiscard]] ExactnessReport report(const Pipe& pipe, const std::string& driver,
                                       const std::optional<PipeTables>& now,
                                       const std::vector<AuditRow>& further) const {
    ExactnessReport report;
    for (const Item& item : items_) report.rows.push_back(row_of(item, now));
    for (const Item& item : leftovers_) report.rows.push_back(row_of(item, now));
    report.rows.insert(report.rows.end(), further.begin(), further.end());
    for (const AuditRow& row : report.rows) evaluate_row(report, row);
    evaluate_driver(report, driver, pipe);
    evaluate_format(report, pipe);
    if (now) evaluate_placement(report, pipe, now->plane);
    evaluate_link(report, pipe);
    evaluate_refresh(report, pipe);
    report.conclude();
    return report;
  }

 private:
  struct Item {
    const ExactnessRule* rule = nullptr;
    Property found;
    uint32_t object = 0;
    std::optional<uint64_t> wanted;
    bool settable = false;
    bool refused = false;

    /// Returns true if `value` limits the link to fewer bits than the frames have.
    [[nodiscard]] bool has_too_few_bits(uint64_t value) const {
      return settable && rule->neutral == Neutral::Depth && found.is_range() && value < *wanted;
    }
  };

  [[nodiscard]] AuditRow row_of(const Item& item, const std::optional<PipeTables>& now) const {
    using enum AuditOutcome;
    const Property* after = now ? now->of(item.rule->object).find(item.rule->property) : nullptr;
    const uint64_t value = after != nullptr ? after->value : item.found.value;
    AuditRow row{.object = object_name(item.rule->object),
                 .property = item.found.name,
                 .found = item.found.text_of(item.found.value),
                 .wanted = item.wanted ? item.found.text_of(*item.wanted) : "?",
                 .now = item.found.text_of(value),
                 .alters_pixels = item.rule->harm == Harm::Pixels || item.has_too_few_bits(value),
                 .effect = item.rule->effect,
                 .remedy = item.rule->remedy};
    if (item.wanted == value)
      row.outcome = item.settable && item.found.value != value ? Forced : Neutral;
    else if (item.settable)
      row.outcome = now || item.refused ? Refused : Planned;
    else
      row.outcome = item.wanted ? ReadOnly : Foreign;
    return row;
  }

  std::vector<Item> items_;
  std::vector<Item> leftovers_;  ///< settings that cannot be written
};

}  // namespace lenticule::display
