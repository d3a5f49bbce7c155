// SPDX-License-Identifier: Apache-2.0
// Holding a camera still: everything that it would change by itself is switched off, everything
// that can be set is set, and what it says afterwards is remembered.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

struct ControlWishes {
  double refresh_hz = 60.0;   ///< of the display
  int exposure_periods = 2;   ///< refreshes per exposure: every row then sees whole ones
  std::optional<int> gain{};  ///< in the camera's own numbers, as are all of these; none: as it is
  std::optional<int> white_balance_kelvin{};
  std::optional<int> focus{};
};

/// A control as the driver describes it. Ranges are clipped to 32 bits.
struct ControlInfo {
  uint32_t id = 0;
  uint32_t type = 0;
  uint32_t flags = 0;
  std::string name;
  int64_t minimum = 0;
  int64_t maximum = 0;
  int64_t step = 1;
};

/// The exposure nearest to so many refreshes that the control can take, in its unit of 100 us:
/// fewer refreshes where the control does not reach so far, more where it does not go so low; if no
/// whole number of them fits, the nearest value.
[[nodiscard]] int64_t whole_refreshes(const ControlInfo& exposure, double refresh_hz, int periods);

/// One thread; the device must outlive it.
class CameraControls {
 public:
  CameraControls(V4l2Device& device, const ControlWishes& wishes);

  /// Switches automatic controls off first, since they make the others inactive, then sets values,
  /// then reads everything back. To be done again after the stream has started: some cameras
  /// forget. 0, or ENODEV if the camera is gone; what else fails is a sentence in unlocked().
  [[nodiscard]] int lock();
  /// What could not be held constant, of the last lock().
  [[nodiscard]] const std::vector<std::string>& unlocked() const { return unlocked_; }
  /// What has changed by itself since the last lock().
  [[nodiscard]] std::vector<std::string> drifted();
  /// Known if the camera says so.
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
  void judge(const Rule& rule, const ControlInfo& control, int64_t wanted, int64_t got);
  void judge_exposure(int64_t got);
  void say_what_is_missing(const std::vector<ControlInfo>& controls);

  V4l2Device& device_;
  ControlWishes wishes_;
  std::vector<Locked> locked_;
  std::vector<std::string> unlocked_;
  std::optional<Nanoseconds> exposure_;
};

}  // namespace lenticule::calib
