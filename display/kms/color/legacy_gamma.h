// SPDX-License-Identifier: Apache-2.0
// LegacyGamma sets the gamma ramp of drivers that support atomic commits and have no GAMMA_LUT
// property. Such a ramp has its own system call, and a ramp left by a night-light program would
// change every value.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

/// Name of the row of the report.
inline constexpr const char* kGammaRampRow = "gamma ramp";

struct GammaRamp {
  std::vector<uint16_t> red, green, blue;  ///< equal lengths; 65535 is full intensity

  friend bool operator==(const GammaRamp&, const GammaRamp&) = default;
};

/// Returns the ramp that maps every 8-bit value to itself.
[[nodiscard]] GammaRamp linear_ramp(size_t entries);

/// Handles the ramp of one CRTC. Functions that return int return 0 or a negative errno. Thread
/// safety: one thread.
class LegacyGamma {
 public:
  /// Reads the current ramp. If look-up tables are properties or the CRTC has no ramp, all
  /// functions of this class do nothing.
  LegacyGamma(int fd, const PropertyTable& crtc);

  int make_linear() const noexcept;
  /// Writes the ramp that was found at the start.
  int restore() const noexcept {
    return present() && found_ && *found_ != linear_ ? write(*found_) : 0;
  }

  /// Returns the row of the report; none if there is no ramp. `committed` is false if the ramp is
  /// only checked and not written.
  [[nodiscard]] std::optional<AuditRow> row(bool committed) const;

 private:
  [[nodiscard]] bool present() const { return !linear_.red.empty(); }
  [[nodiscard]] std::optional<GammaRamp> read() const;
  int write(const GammaRamp& ramp) const noexcept;

  int fd_;
  uint32_t crtc_;
  GammaRamp linear_;                ///< empty: there is no ramp
  std::optional<GammaRamp> found_;  ///< none if the ramp could not be read
};

}  // namespace lenticule::display
