// SPDX-License-Identifier: Apache-2.0
// CameraControls keeps a camera constant: it switches off all automatic controls, sets all manual
// ones, and remembers the values that the camera reports afterwards.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

struct ControlRequests {
  double refresh_hz = 60.0;  ///< refresh rate of the display
  int exposure_periods =
      2;  ///< refreshes per exposure: every row is then exposed for whole refreshes
  std::optional<int> gain{};  ///< camera's own units, like the next two; absent: unchanged
  std::optional<int> white_balance_kelvin{};
  std::optional<int> focus{};
};

/// ControlInfo describes a control as the driver reports it. Ranges are clipped to 32 bits.
struct ControlInfo {
  uint32_t id = 0;
  uint32_t type = 0;
  uint32_t flags = 0;
  std::string name;
  int64_t minimum = 0;
  int64_t maximum = 0;
  int64_t step = 1;
};

/// Returns the exposure nearest to `periods` refreshes that the control supports, in its unit of
/// 100 us: fewer refreshes if the control's maximum is too small, more if its minimum is too large;
/// if no whole number of refreshes fits, the nearest value.
[[nodiscard]] int64_t whole_refreshes(const ControlInfo& exposure, double refresh_hz, int periods);

/// CameraControls locks the controls of one camera.
///
/// Thread safety: one thread.
///
/// Lifetime: the device must outlive this object.
class CameraControls {
 public:
  CameraControls(V4l2Device& device, const ControlRequests& requests);

  /// Switches automatic controls off first, since they make the others inactive, then sets values,
  /// then reads all values back. Call it again after the stream has started, because some cameras
  /// forget the values. Returns 0, or ENODEV if the camera is gone; other failures become sentences
  /// in unlocked().
  [[nodiscard]] int lock();
  /// Returns the properties that the last lock() could not hold constant.
  [[nodiscard]] const std::vector<std::string>& unlocked() const { return unlocked_; }
  /// Returns the controls that have changed by themselves since the last lock().
  [[nodiscard]] std::vector<std::string> drifted();
  /// Returns the exposure time, if the camera reports it.
  [[nodiscard]] std::optional<Nanoseconds> exposure() const { return exposure_; }

 private:
  struct Rule;
  struct Locked {
    uint32_t id;
    std::string name;
    int64_t value;
  };
  static const std::vector<Rule>& rules();
  static bool is_essential(const Rule& rule);

  [[nodiscard]] std::vector<ControlInfo> enumerate();
  [[nodiscard]] std::optional<ControlInfo> query(uint32_t id_and_flags);
  [[nodiscard]] int read(uint32_t id, int64_t& value);
  [[nodiscard]] int write(uint32_t id, int64_t value);
  [[nodiscard]] int apply(const Rule& rule);
  [[nodiscard]] int set(const Rule& rule, const ControlInfo& control, int64_t wanted);
  [[nodiscard]] int keep(const Rule& rule, const ControlInfo& control);
  [[nodiscard]] std::optional<int64_t> wanted_value(const Rule& rule, const ControlInfo& control);
  void evaluate(const Rule& rule, const ControlInfo& control, int64_t wanted, int64_t got);
  void evaluate_exposure(int64_t got);
  void say_what_is_missing(const std::vector<ControlInfo>& controls);

  V4l2Device& device_;
  ControlRequests requests_;
  std::vector<Locked> locked_;
  std::vector<std::string> unlocked_;
  std::optional<Nanoseconds> exposure_;
};

}  // namespace lenticule::calib
