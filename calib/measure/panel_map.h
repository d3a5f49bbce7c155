// SPDX-License-Identifier: Apache-2.0
// PanelMap maps camera pixels to panel points with one smooth map of the whole picture: a
// homography and a polynomial for its residual (lens distortion, refraction). Under a lens sheet
// the panel points of single pixels jump from lens to lens; the map goes through their middle.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "optics/vec.h"

namespace lenticule::calib {

/// Sighting is a camera pixel (its centre is at whole + 1/2) and the panel point seen there, in
/// pixels of both.
struct Sighting {
  Vec2 camera_px;
  Vec2 panel_px;
  double weight = 1.0;
};

using Homography = std::array<double, 9>;  ///< row by row

/// Returns the homography that maps camera to panel with the least squares of panel distance.
/// Returns nothing for fewer than four points or points on a line.
[[nodiscard]] std::optional<Homography> fit_homography(const std::vector<Sighting>& sightings);
[[nodiscard]] Vec2 map_through(const Homography& h, Vec2 p);

class PanelMap {
 public:
  /// Fits a map through at least 30 sightings all over the picture, some of which may be wrong.
  /// Returns nothing if there is no such map.
  [[nodiscard]] static std::optional<PanelMap> fit(const std::vector<Sighting>& sightings);

  [[nodiscard]] Vec2 at(Vec2 camera_px) const;
  /// Returns the median distance of the sightings from the map, panel pixels.
  [[nodiscard]] double typical_error_px() const { return typical_error_px_; }

 private:
  static constexpr int kDegree = 5;
  static constexpr int kTerms = (kDegree + 1) * (kDegree + 2) / 2;

  [[nodiscard]] std::array<double, kTerms> terms(Vec2 camera_px) const;
  bool fit_polynomial(const std::vector<Sighting>& sightings, const std::vector<double>& errors);
  [[nodiscard]] std::vector<double> errors_of(const std::vector<Sighting>& sightings) const;

  Homography homography_{};
  std::array<Vec2, kTerms> polynomial_{};
  Vec2 middle_;
  double scale_ = 1.0;
  double typical_error_px_ = 0.0;
};

}  // namespace lenticule::calib
