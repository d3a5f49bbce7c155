// SPDX-License-Identifier: Apache-2.0
// Camera is the interface of calibration to cameras: pictures in linear light, one after the other,
// each with the time of its exposure. V4L2 cameras, folders of photographs and simulated cameras
// implement it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "frames/capture/grab_status.h"

namespace lenticule::calib {

/// Nanoseconds of CLOCK_MONOTONIC, or of the simulated clock.
using Nanoseconds = std::chrono::nanoseconds;

/// Light from this value on counts as clipped.
inline constexpr float kSaturatedLight = 0.99F;

/// CameraPicture holds rows from the top, channels interleaved: light[(row * width + column) *
/// channels + channel]. 0 is black and 1 is the light of the largest code, linear as far as the
/// camera's curve is known.
struct CameraPicture {
  int width = 0;
  int height = 0;
  int channels = 0;  ///< 1 or 3 (R, G, B)
  std::vector<float> light;
  uint64_t sequence = 0;  ///< the camera's own count; a gap is a lost picture
  Nanoseconds time{0};    ///< middle of the exposure
};

using frames::capture::GrabStatus;

struct CameraFacts {
  std::string name{};
  std::string identity{};  ///< serial or bus address, empty if there is none
  int width = 0;
  int height = 0;
  int channels = 0;
  double frames_per_second = 0.0;
  std::string pixel_format{};  ///< "YUYV", "photographs", "simulated"
  /// Properties that could not be held constant, each a sentence for users: "no manual focus".
  std::vector<std::string> unlocked{};
};

/// Camera provides pictures.
///
/// Thread safety: one thread.
class Camera {
 public:
  virtual ~Camera() = default;

  [[nodiscard]] virtual const CameraFacts& facts() const = 0;

  /// Gets the next picture whose exposure's middle is not before `not_before`; waits at most
  /// `timeout`. Earlier pictures are dropped without decoding; a camera without a clock ignores
  /// `not_before`. Reuses the memory of `out`. Pictures come in the order of their exposure;
  /// pictures that are not grabbed in time may be lost.
  [[nodiscard]] virtual GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                        Nanoseconds not_before = Nanoseconds::min()) = 0;

  /// Returns the time on the clock of CameraPicture::time.
  [[nodiscard]] virtual Nanoseconds now() const = 0;

  /// Reads the locked controls back. Returns one sentence for each control that changed by itself;
  /// empty = none.
  [[nodiscard]] virtual std::vector<std::string> drifted_controls() = 0;

  /// Returns the reason why the camera is Gone.
  [[nodiscard]] virtual std::string failure() const = 0;
};

}  // namespace lenticule::calib
