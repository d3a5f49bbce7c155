// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/error_controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lenticule::tools {
namespace {

/// Part of the frame period to use; the rest is for frames that take longer than others.
constexpr double kUsed = 0.95;
/// Largest deviation from that time, as log2 of the ratio, at which the error stays: 5 %.
constexpr double kEnough = 0.07;
constexpr double kLeastPower = 0.25;
constexpr double kFirstPower = 1.0;
constexpr double kMostPower = 2.5;
constexpr double kGrowth = 1.3;
/// Largest correction at a time: one scene cut must not move the error from end to end.
constexpr double kMostOctaves = 1.5;

}  // namespace

ErrorController::ErrorController(double frames_per_s)
    : target_s_(kUsed / frames_per_s), log2_error_(std::log2(kFirstError)), power_(kFirstPower) {
  if (!(frames_per_s >= 0.01 && frames_per_s <= 1000.0))
    throw Error(
        ErrorKind::Usage,
        fmt::format("--adapt-error {}: not in 0.01 ... 1000 frames per second", frames_per_s));
}

double ErrorController::error() const noexcept {
  return std::exp2(log2_error_);
}

void ErrorController::add_frame(double seconds) noexcept {
  times_[count_++] = std::max(seconds, 1e-6);
  if (count_ < kFrames) return;
  count_ = 0;
  std::ranges::sort(times_);
  const double ratio = std::log2(times_[kFrames / 2] / target_s_);
  if (std::abs(ratio) <= kEnough) return;
  if (last_step_ * ratio < 0.0) power_ = std::max(kLeastPower, power_ / 2.0);
  const double before = log2_error_;
  const double step = std::clamp(power_ * ratio, -kMostOctaves, kMostOctaves);
  log2_error_ = std::clamp(before + step, std::log2(kLeastError), std::log2(kMostError));
  if (last_step_ * ratio > 0.0) power_ = std::min(kMostPower, power_ * kGrowth);
  // A step that the limits swallow says nothing about the next one.
  last_step_ = log2_error_ - before;
}

}  // namespace lenticule::tools
