// SPDX-License-Identifier: Apache-2.0
// ErrorController chooses the tolerated error of method adaptive, frame by frame, so that a live
// renderer holds a rate.
#pragma once

#include <array>
#include <cstddef>

namespace lenticule::tools {

/// It compares the median time of three frames with the time that the rate allows, and multiplies
/// the error by a power of that ratio. The power is halved when the correction changes direction,
/// and grows while it does not, so that the error converges without swinging, no matter how much
/// time a larger error saves. Within a few percent of the rate the error stays as it is.
///
/// Thread safety: one thread.
class ErrorController {
 public:
  static constexpr double kLeastError = 0.5;  ///< code values
  static constexpr double kMostError = 16.0;
  static constexpr double kFirstError = 2.0;

  /// Throws Error(Usage) unless the rate is between 0.01 and 1000 frames per second.
  explicit ErrorController(double frames_per_s);

  /// Returns the error to tolerate in the next frame, in code values.
  [[nodiscard]] double error() const noexcept;
  /// Reports the time that the frame with error() took, without waits for the player.
  void add_frame(double seconds) noexcept;

 private:
  static constexpr size_t kFrames = 3;

  double target_s_;
  double log2_error_;
  double power_;
  double last_step_ = 0.0;
  std::array<double, kFrames> times_{};
  size_t count_ = 0;
};

}  // namespace lenticule::tools
