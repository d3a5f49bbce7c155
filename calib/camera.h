// SPDX-License-Identifier: Apache-2.0
// A camera as calibration sees it: pictures in linear light, one after the other, each with the
// time of its exposure. V4L2 cameras, folders of photographs and simulated cameras are the same to
// it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace lenticule::calib {

/// Nanoseconds of CLOCK_MONOTONIC, or of the simulated clock.
using Nanoseconds = std::chrono::nanoseconds;

/// Light from here on is held for clipped.
inline constexpr float kSaturatedLight = 0.99F;

/// Rows from the top, channels side by side: light[(row * width + column) * channels + channel].
/// 0 is black and 1 what the largest code stands for, linear as far as the camera's curve is known.
struct CameraPicture {
  int width = 0;
  int height = 0;
  int channels = 0;  ///< 1 or 3 (R, G, B)
  std::vector<float> light;
  uint64_t sequence = 0;  ///< the camera's own count; a gap is a lost picture
  Nanoseconds time{0};    ///< middle of the exposure
};

enum class GrabStatus {
  Ready,     ///< a whole picture
  TimedOut,  ///< none until the deadline; the camera is still usable
  Corrupt,   ///< the picture is damaged and was dropped; grab again
  Gone,      ///< unplugged or broken for good; failure() says why
};

struct CameraFacts {
  std::string name;
  std::string identity;  ///< serial or bus address, empty if there is none
  int width = 0;
  int height = 0;
  int channels = 0;
  double frames_per_second = 0.0;
  std::string pixel_format;  ///< "YUYV", "photographs", "simulated"
  /// What could not be held constant, each a sentence for people: "no manual focus".
  std::vector<std::string> unlocked;
};

/// One thread uses a camera.
class Camera {
 public:
  virtual ~Camera() = default;

  [[nodiscard]] virtual const CameraFacts& facts() const = 0;

  /// The next picture whose exposure's middle is not before `not_before`, waiting at most
  /// `timeout`. Earlier ones are dropped undecoded; a camera without a clock ignores it. Reuses the
  /// memory of `out`. Pictures come in the order of their exposure; those nobody grabbed in time
  /// may be lost.
  [[nodiscard]] virtual GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                        Nanoseconds not_before = Nanoseconds::min()) = 0;

  /// The clock of CameraPicture::time.
  [[nodiscard]] virtual Nanoseconds now() const = 0;

  /// Reads the locked controls back; what changed by itself, one sentence each. Empty = nothing.
  [[nodiscard]] virtual std::vector<std::string> drifted_controls() = 0;

  /// Why the camera is Gone.
  [[nodiscard]] virtual std::string failure() const = 0;
};

}  // namespace lenticule::calib
