// SPDX-License-Identifier: Apache-2.0
// Crosstalk compensation: a lens's spot shows an eye its neighbours' views too. Views are changed
// beforehand so that what arrives is closer to what was meant.
//
// With W the share of each view that an eye in the middle of each view gets, the views L' minimise
// |W L' - L|^2 + e |L' - L|^2 in linear light, per pixel and colour, and are clamped to what a
// panel can show. e = 0 where W can be inverted as it is.
#pragma once

#include <string>
#include <vector>

#include "frames/quilt.h"

namespace lenticule::frames {

struct Crosstalk {
  /// Share of the view itself, of each neighbour, of each second neighbour, ...: at the ends of the
  /// lobe what is missing is shared among the others.
  std::vector<double> shares;
  double restraint = 0.0;  ///< e
};

/// `percent` of the light comes from the two neighbours together, 0 to 40. Throws Error(Usage).
[[nodiscard]] Crosstalk crosstalk_of_percent(double percent);
/// As wide as a Gaussian spot of so many views. Wide spots cannot be undone: e = 0.01 keeps noise
/// from growing by more than five times.
[[nodiscard]] Crosstalk crosstalk_of_spot(double sigma_views);

/// More views than this are refused: the system is solved whole.
inline constexpr int kMostCompensatedViews = 256;

/// The matrix by which views are multiplied, row by row; each row sums to 1.
[[nodiscard]] std::vector<double> compensation_matrix(const Crosstalk& crosstalk, int views);

/// Throws Error(Usage) for more than kMostCompensatedViews views.
[[nodiscard]] ViewSet compensate(const ViewSet& views, const Crosstalk& crosstalk);

}  // namespace lenticule::frames
