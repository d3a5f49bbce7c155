// SPDX-License-Identifier: Apache-2.0
#include "display/kms/color/link_readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

namespace lenticule::display {
namespace {

constexpr const char* kLateRemedy =
    "boot with i915.enable_psr=0 or amdgpu.dcdebugmask=0x10 if vblanks are missed";

/// A file that contains one value.
struct LinkFile {
  const char* row;
  const char* path;    ///< {0}: the card's name, {1}: its number, {2}: the connector's name
  const char* before;  ///< the value follows this text and ends with its line
  const char* wanted;
  bool alters_pixels;
  const char* effect;
  const char* remedy;
};

constexpr LinkFile kSysfs[] = {
    {"panel_power_savings", "/sys/class/drm/{0}-{2}/amdgpu/panel_power_savings", "", "0", true,
     "brightness changes with the picture",
     "write 0 to amdgpu/panel_power_savings of the connector in /sys/class/drm, and keep "
     "power-profiles-daemon and tuned from raising it"},
};

constexpr LinkFile kDebugfs[] = {
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
};

/// Returns "card1" and "1" for "/dev/dri/card1".
std::optional<std::pair<std::string, std::string>> card_names(const std::string& path) {
  constexpr std::string_view kPrefix = "/dev/dri/card";
  if (!path.starts_with(kPrefix) || path.size() == kPrefix.size()) return std::nullopt;
  return std::pair{path.substr(kPrefix.size() - 4), path.substr(kPrefix.size())};
}

std::string line_after(std::string_view text, std::string_view before) {
  const size_t at = text.find(before);
  if (at == std::string_view::npos) return {};
  std::string_view line = text.substr(at + before.size());
  const auto ends_line = [](char character) { return character == '\n' || character == '\0'; };
  line = line.substr(
      0, static_cast<size_t>(std::find_if(line.begin(), line.end(), ends_line) - line.begin()));
  return std::string(line);
}

AuditRow row_for(const LinkFile& file, const std::string& value) {
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

template <size_t N>
std::vector<AuditRow> read_files(KmsPlatform& platform, const LinkPlace& place,
                                 const LinkFile (&files)[N]) {
  std::vector<AuditRow> rows;
  const auto names = card_names(place.card);
  if (!names) return rows;
  for (const LinkFile& file : files) {
    const auto text = platform.read_kernel_file(
        fmt::format(fmt::runtime(file.path), names->first, names->second, place.connector));
    const std::string value = text ? line_after(*text, file.before) : std::string();
    if (!value.empty()) rows.push_back(row_for(file, value));
  }
  return rows;
}

/// Returns the section of one CRTC in a list in which each begins with "[CRTC:42:pipe A]:".
std::string_view section_of(std::string_view text, uint32_t crtc) {
  const size_t begin = text.find(fmt::format("[CRTC:{}:", crtc));
  if (begin == std::string_view::npos) return {};
  const size_t end = text.find("\n[C", begin);
  return text.substr(begin, end == std::string_view::npos ? end : end - begin);
}

/// Parses "dither=no, bpp=24" of i915/display/intel_display_debugfs.c, intel_crtc_info().
std::optional<AuditRow> depth_row(KmsPlatform& platform, const LinkPlace& place,
                                  const std::string& number) {
  const auto text =
      platform.read_kernel_file(fmt::format("/sys/kernel/debug/dri/{}/i915_display_info", number));
  if (!text) return std::nullopt;
  const std::string value = line_after(section_of(*text, place.crtc), "dither=");
  if (value.empty()) return std::nullopt;
  const bool deep = place.depth == ScanoutDepth::Bits10;
  return row_for({kDepthRow, "", "", deep ? "no, bpp=30" : "no, bpp=24", true,
                  "low bits are cut off or dithered",
                  deep ? "use a mode that the link carries with 10 bits per colour, or state "
                         "panel.bits = 8 in the rig"
                       : "use a mode that the link carries with 8 bits per colour"},
                 value);
}

/// Parses "DRRS Enabled: no" of i915_drrs_status(), same file.
std::optional<AuditRow> drrs_row(KmsPlatform& platform, const LinkPlace& place,
                                 const std::string& number) {
  const auto text =
      platform.read_kernel_file(fmt::format("/sys/kernel/debug/dri/{}/i915_drrs_status", number));
  if (!text) return std::nullopt;
  const std::string value = line_after(section_of(*text, place.crtc), "DRRS Enabled: ");
  if (value.empty()) return std::nullopt;
  return row_for(
      {"DRRS", "", "", "no", false, "the refresh rate drops while the picture does not change",
       "set the driver to one refresh rate (i915: drrs in its debug files)"},
      value);
}

}  // namespace

std::vector<AuditRow> read_sysfs_rows(KmsPlatform& platform, const LinkPlace& place) {
  return read_files(platform, place, kSysfs);
}

std::vector<AuditRow> read_debugfs_rows(KmsPlatform& platform, const LinkPlace& place) {
  std::vector<AuditRow> rows = read_files(platform, place, kDebugfs);
  const auto names = card_names(place.card);
  if (!names) return rows;
  if (auto row = depth_row(platform, place, names->second)) rows.push_back(std::move(*row));
  if (auto row = drrs_row(platform, place, names->second)) rows.push_back(std::move(*row));
  return rows;
}

}  // namespace lenticule::display
