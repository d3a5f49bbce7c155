// SPDX-License-Identifier: Apache-2.0
// CameraControls keeps a camera constant: it switches off all automatic controls, sets all manual
// ones, and remembers the values that the camera reports afterwards.
#pragma once

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "frames/capture/v4l2_device.h"

namespace lenticule::calib {

using namespace frames::capture;

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

inline constexpr int kMostControls = 1024;
inline constexpr double kExposureUnitsPerSecond = 10000.0;
inline constexpr double kPartOfRefreshAllowed = 0.02;
inline constexpr uint32_t kUnsettable =
    V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE | V4L2_CTRL_FLAG_GRABBED;

inline int64_t clipped(int64_t value) {
  return std::clamp<int64_t>(value, std::numeric_limits<int32_t>::min(),
                             std::numeric_limits<int32_t>::max());
}

inline bool is_number(uint32_t type) {
  return type == V4L2_CTRL_TYPE_INTEGER || type == V4L2_CTRL_TYPE_BOOLEAN ||
         type == V4L2_CTRL_TYPE_MENU || type == V4L2_CTRL_TYPE_INTEGER_MENU ||
         type == V4L2_CTRL_TYPE_BITMASK;
}

/// Returns the nearest value that the control supports.
inline int64_t within(const ControlInfo& control, int64_t value) {
  if (control.maximum <= control.minimum) return control.minimum;
  const int64_t held = std::clamp(value, control.minimum, control.maximum);
  if (control.type != V4L2_CTRL_TYPE_INTEGER) return held;
  const int64_t steps = (held - control.minimum + control.step / 2) / control.step;
  const int64_t last = (control.maximum - control.minimum) / control.step;
  return control.minimum + std::min(steps, last) * control.step;
}

inline bool has_any(std::span<const ControlInfo> controls, std::initializer_list<uint32_t> ids) {
  return std::any_of(controls.begin(), controls.end(), [&](const ControlInfo& control) {
    return std::find(ids.begin(), ids.end(), control.id) != ids.end();
  });
}

/// Returns the exposure nearest to `periods` refreshes that the control supports, in its unit of
/// 100 us: fewer refreshes if the control's maximum is too small, more if its minimum is too large;
/// if no whole number of refreshes fits, the nearest value.
[[nodiscard]] inline int64_t whole_refreshes(const ControlInfo& exposure, double refresh_hz,
                                             int periods) {
  const double period = kExposureUnitsPerSecond / refresh_hz;
  const auto most =
      static_cast<int64_t>(std::floor(static_cast<double>(exposure.maximum) / period));
  const auto fewest =
      static_cast<int64_t>(std::ceil(static_cast<double>(exposure.minimum) / period));
  const int64_t lowest = std::max<int64_t>(fewest, 1);
  const int64_t count = std::clamp<int64_t>(periods, lowest, std::max(lowest, most));
  return within(exposure, std::llround(static_cast<double>(count) * period));
}

/// CameraControls locks the controls of one camera.
///
/// Thread safety: one thread.
///
/// Lifetime: the device must outlive this object.
class CameraControls {
 public:
  CameraControls(V4l2Device& device, const ControlRequests& requests)
      : device_(device), requests_(requests) {}

  /// Switches automatic controls off first, since they make the others inactive, then sets values,
  /// then reads all values back. Call it again after the stream has started, because some cameras
  /// forget the values. Returns 0, or ENODEV if the camera is gone; other failures become sentences
  /// in unlocked().
  [[nodiscard]] int lock() {
    locked_.clear();
    unlocked_.clear();
    exposure_.reset();
    const std::vector<ControlInfo> controls = enumerate();
    for (const Rule& rule : rules())
      if (has_any(controls, {rule.id}) && apply(rule) == ENODEV) return ENODEV;
    say_what_is_missing(controls);
    // Enumerating always ends with an error, so a capability query detects a camera that is gone.
    v4l2_capability capability{};
    return v4l2_call(device_, VIDIOC_QUERYCAP, &capability) == ENODEV ? ENODEV : 0;
  }
  /// Returns the properties that the last lock() could not hold constant.
  [[nodiscard]] const std::vector<std::string>& unlocked() const { return unlocked_; }
  /// Returns the controls that have changed by themselves since the last lock().
  [[nodiscard]] std::vector<std::string> drifted() {
    std::vector<std::string> changes;
    for (const Locked& locked : locked_) {
      int64_t value = 0;
      const int error = transfer(VIDIOC_G_EXT_CTRLS, locked.id, value);
      if (error != 0) {
        changes.push_back(fmt::format("{} cannot be read: {}", locked.name, error_text(error)));
        if (error == ENODEV) break;  // all other controls would fail too
      } else if (value != locked.value) {
        changes.push_back(fmt::format("{} was {} and is now {}", locked.name, locked.value, value));
      }
    }
    return changes;
  }
  /// Returns the exposure time, if the camera reports it.
  [[nodiscard]] std::optional<Nanoseconds> exposure() const { return exposure_; }

 private:
  /// Rule is the treatment of one control, if a camera has it. Rules are applied in their order.
  struct Rule {
    enum class Aim { Value, Requested, Minimum, Maximum, Exposure };
    uint32_t id;
    Aim aim = Aim::Value;
    std::optional<int64_t> value{};  ///< for Value and Requested; null keeps the setting
    [[nodiscard]] bool is_essential() const {
      return aim == Aim::Requested || aim == Aim::Exposure;
    }
  };
  struct Locked {
    uint32_t id;
    std::string name;
    int64_t value;
  };
  [[nodiscard]] std::vector<Rule> rules() const {
    using enum Rule::Aim;
    return {
        {V4L2_CID_SCENE_MODE, Value, V4L2_SCENE_MODE_NONE},
        {V4L2_CID_EXPOSURE_AUTO, Value, V4L2_EXPOSURE_MANUAL},
        {V4L2_CID_EXPOSURE_AUTO_PRIORITY, Value, 0},
        {V4L2_CID_AUTOGAIN, Value, 0},
        {V4L2_CID_ISO_SENSITIVITY_AUTO, Value, V4L2_ISO_SENSITIVITY_MANUAL},
        {V4L2_CID_AUTO_WHITE_BALANCE, Value, 0},
        {V4L2_CID_AUTO_N_PRESET_WHITE_BALANCE, Value, V4L2_WHITE_BALANCE_MANUAL},
        {V4L2_CID_FOCUS_AUTO, Value, 0},
        {V4L2_CID_HUE_AUTO, Value, 0},
        {V4L2_CID_AUTOBRIGHTNESS, Value, 0},
        {V4L2_CID_WIDE_DYNAMIC_RANGE, Value, 0},
        {V4L2_CID_IMAGE_STABILIZATION, Value, 0},
        {V4L2_CID_BACKLIGHT_COMPENSATION, Minimum},
        {V4L2_CID_POWER_LINE_FREQUENCY, Value, V4L2_CID_POWER_LINE_FREQUENCY_DISABLED},
        {V4L2_CID_SHARPNESS, Minimum},
        {V4L2_CID_EXPOSURE_ABSOLUTE, Exposure},
        {V4L2_CID_EXPOSURE},
        {V4L2_CID_GAIN, Requested, requests_.gain},
        {V4L2_CID_ANALOGUE_GAIN},
        {V4L2_CID_DIGITAL_GAIN},
        {V4L2_CID_ISO_SENSITIVITY},
        {V4L2_CID_WHITE_BALANCE_TEMPERATURE, Requested, requests_.white_balance_kelvin},
        {V4L2_CID_RED_BALANCE},
        {V4L2_CID_BLUE_BALANCE},
        {V4L2_CID_FOCUS_ABSOLUTE, Requested, requests_.focus},
        {V4L2_CID_IRIS_ABSOLUTE},
        {V4L2_CID_ZOOM_ABSOLUTE},
        {V4L2_CID_PAN_ABSOLUTE},
        {V4L2_CID_TILT_ABSOLUTE},
        {V4L2_CID_BRIGHTNESS},
        {V4L2_CID_CONTRAST},
        {V4L2_CID_SATURATION},
        {V4L2_CID_HUE},
        {V4L2_CID_GAMMA},
        {V4L2_CID_3A_LOCK, Maximum},
    };
  }

  [[nodiscard]] std::vector<ControlInfo> enumerate() {
    std::vector<ControlInfo> controls;
    uint32_t last = 0;
    for (int i = 0; i < kMostControls; ++i) {
      const std::optional<ControlInfo> next = query(last | V4L2_CTRL_FLAG_NEXT_CTRL);
      if (!next || next->id <= last)
        break;  // guards against a driver that repeats itself endlessly
      last = next->id;
      if (is_number(next->type) && (next->flags & V4L2_CTRL_FLAG_DISABLED) == 0)
        controls.push_back(*next);
    }
    return controls;
  }
  [[nodiscard]] std::optional<ControlInfo> query(uint32_t id_and_flags) {
    v4l2_query_ext_ctrl asked{};
    asked.id = id_and_flags;
    if (v4l2_call(device_, VIDIOC_QUERY_EXT_CTRL, &asked) != 0) return std::nullopt;
    const uint64_t step = std::clamp<uint64_t>(asked.step, 1, std::numeric_limits<int32_t>::max());
    return ControlInfo{.id = asked.id,
                       .type = asked.type,
                       .flags = asked.flags,
                       .name = {asked.name, strnlen(asked.name, sizeof asked.name)},
                       .minimum = clipped(asked.minimum),
                       .maximum = clipped(asked.maximum),
                       .step = static_cast<int64_t>(step)};
  }
  /// Reads or writes the value, as `request` says.
  [[nodiscard]] int transfer(unsigned long request, uint32_t id, int64_t& value) {
    v4l2_ext_control control{};
    control.id = id;
    control.value = static_cast<int32_t>(clipped(value));
    v4l2_ext_controls controls{};
    controls.which = V4L2_CTRL_WHICH_CUR_VAL;
    controls.count = 1;
    controls.controls = &control;
    const int error = v4l2_call(device_, request, &controls);
    value = control.value;
    return error;
  }
  /// Returns ENODEV if the camera is gone, else 0.
  [[nodiscard]] int apply(const Rule& rule) {
    // Queried again, because switching off another control may have made this one active.
    const std::optional<ControlInfo> control = query(rule.id);
    if (!control) return 0;
    const std::optional<int64_t> wanted = wanted_value(rule, *control);
    return wanted ? set(rule, *control, *wanted) : keep(rule, *control);
  }
  [[nodiscard]] int set(const Rule& rule, const ControlInfo& control, int64_t wanted) {
    const bool inactive = (control.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
    if (inactive && !rule.is_essential()) return 0;  // the control has no effect in this state
    int error = EACCES;
    int64_t got = wanted;
    if ((control.flags & kUnsettable) == 0) error = transfer(VIDIOC_S_EXT_CTRLS, rule.id, got);
    if (error == 0) error = transfer(VIDIOC_G_EXT_CTRLS, rule.id, got);
    if (error == ENODEV) return ENODEV;
    if (error != 0) {
      unlocked_.push_back(fmt::format("{} cannot be set: {}", control.name,
                                      inactive ? "it is automatic" : error_text(error)));
      return 0;
    }
    locked_.push_back({.id = rule.id, .name = control.name, .value = got});
    if (rule.aim == Rule::Aim::Exposure)
      evaluate_exposure(got);
    else if (got != wanted)
      unlocked_.push_back(
          fmt::format("{}: set to {}, but the camera has {}", control.name, wanted, got));
    return 0;
  }
  [[nodiscard]] int keep(const Rule& rule, const ControlInfo& control) {
    constexpr uint32_t kMoving = V4L2_CTRL_FLAG_INACTIVE | V4L2_CTRL_FLAG_VOLATILE;
    if ((control.flags & kMoving) != 0) {
      if (rule.is_essential()) unlocked_.push_back(control.name + " is automatic");
      return 0;
    }
    int64_t value = 0;
    const int error = transfer(VIDIOC_G_EXT_CTRLS, rule.id, value);
    if (error == 0) locked_.push_back({.id = rule.id, .name = control.name, .value = value});
    return error == ENODEV ? ENODEV : 0;
  }
  [[nodiscard]] std::optional<int64_t> wanted_value(const Rule& rule, const ControlInfo& control) {
    if (rule.aim == Rule::Aim::Minimum) return control.minimum;
    if (rule.aim == Rule::Aim::Maximum) return control.maximum;
    if (rule.aim != Rule::Aim::Exposure) return rule.value;
    return whole_refreshes(control, requests_.refresh_hz, requests_.exposure_periods);
  }
  void evaluate_exposure(int64_t got) {
    exposure_ = std::chrono::microseconds{100 * got};
    const double refreshes =
        static_cast<double>(got) / kExposureUnitsPerSecond * requests_.refresh_hz;
    // The control's unit alone gives an error of half of 100 us.
    const double allowed =
        kPartOfRefreshAllowed + 0.5 / kExposureUnitsPerSecond * requests_.refresh_hz;
    if (refreshes > 0.5 && std::abs(refreshes - std::round(refreshes)) <= allowed) return;
    unlocked_.push_back(
        fmt::format("exposures of {:.1f} ms are not whole refreshes of {:.2f} ms: bands may move "
                    "through the pictures",
                    static_cast<double>(got) / 10.0, 1000.0 / requests_.refresh_hz));
  }
  void say_what_is_missing(const std::vector<ControlInfo>& controls) {
    if (!has_any(controls, {V4L2_CID_EXPOSURE_ABSOLUTE}))
      unlocked_.emplace_back(
          has_any(controls, {V4L2_CID_EXPOSURE})
              ? "no exposure control in seconds: bands may move through the pictures"
              : "no manual exposure");
    if (!has_any(controls, {V4L2_CID_GAIN, V4L2_CID_ANALOGUE_GAIN, V4L2_CID_ISO_SENSITIVITY}))
      unlocked_.emplace_back("no manual gain");
    if (!has_any(controls, {V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CID_RED_BALANCE}))
      unlocked_.emplace_back("no manual white balance");
    if (!has_any(controls, {V4L2_CID_FOCUS_ABSOLUTE})) unlocked_.emplace_back("no manual focus");
  }

  V4l2Device& device_;
  ControlRequests requests_;
  std::vector<Locked> locked_;
  std::vector<std::string> unlocked_;
  std::optional<Nanoseconds> exposure_;
};

}  // namespace lenticule::calib
