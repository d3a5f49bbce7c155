// SPDX-License-Identifier: Apache-2.0
// The gamma ramp of drivers that take atomic commits but have no GAMMA_LUT property: it is set by a
// call of its own, and whatever a night light left in it maps every value to another.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "display/kms/color/exactness_report.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {

struct GammaRamp {
  std::vector<uint16_t> red, green, blue;  ///< of equal length; 65535 is full

  friend bool operator==(const GammaRamp&, const GammaRamp&) = default;
};

/// The ramp that maps every 8-bit value to itself.
[[nodiscard]] GammaRamp linear_ramp(size_t entries);

/// Of one CRTC. Calls that return int return 0 or a negative errno. One thread.
class LegacyGamma {
 public:
  /// Reads what is set. Where look-up tables are properties, or the CRTC has no ramp, nothing of
  /// this does anything.
  LegacyGamma(int fd, const PropertyTable& crtc);

  int make_linear() const noexcept;
  /// Puts back what was found.
  int restore() const noexcept;

  /// For the report; none where there is no ramp. `committed` is false when nothing was to be
  /// written, only to be looked at.
  [[nodiscard]] std::optional<AuditRow> row(bool committed) const;

 private:
  [[nodiscard]] bool present() const { return !linear_.red.empty(); }
  [[nodiscard]] std::optional<GammaRamp> read() const;
  int write(const GammaRamp& ramp) const noexcept;

  int fd_;
  uint32_t crtc_;
  GammaRamp linear_;                ///< empty: there is no ramp
  std::optional<GammaRamp> found_;  ///< none if it could not be read
};

}  // namespace lenticule::display
