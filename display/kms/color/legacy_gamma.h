// SPDX-License-Identifier: Apache-2.0
// LegacyGamma sets the gamma ramp of drivers that support atomic commits and have no GAMMA_LUT
// property. Such a ramp has its own system call, and a ramp left by a night-light program would
// change every value.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/color/exactness_rules.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

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

}  // namespace lenticule::display
