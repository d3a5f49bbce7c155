// SPDX-License-Identifier: Apache-2.0
// Chooses the frames of a film from which to calibrate: a phone was moved past the chart.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/phone/phone_calibration.h"

namespace lenticule::calib {

/// FilmFrame is what a frame shows before its fringes are measured: tags and place of the camera.
struct FilmFrame {
  uint64_t number = 0;  ///< frames of the film before it
  double seconds = 0.0;
  PhotoFindings found;
};

/// FilmChoice holds the chosen frames, in their order, and the motion of each.
struct FilmChoice {
  struct Chosen {
    size_t frame = 0;  ///< index
    PhotoMotion motion;
  };
  std::vector<Chosen> frames;  ///< none if the film is refused
  size_t whole = 0;            ///< frames that show the whole chart
  size_t sharp = 0;            ///< whole and sharp frames whose neighbours show their motion
  /// Focal length in pixels of the film, roughly: a start for the measurement of single frames.
  std::optional<Estimate> focal_px = {};
  std::string refusal;  ///< why the film cannot be used; empty if it can
};

/// Chooses up to kMostFilmFrames sharp frames of the whole chart from places far apart. `frames`
/// are a part of the film, in its order.
[[nodiscard]] FilmChoice choose_frames(const std::vector<FilmFrame>& frames,
                                       const SinglePhotoChart& chart);

inline constexpr size_t kMostFilmFrames = 10;
inline constexpr double kLongestFilmSeconds = 60.0;

}  // namespace lenticule::calib
