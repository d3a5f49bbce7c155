// SPDX-License-Identifier: Apache-2.0
// Crosstalk compensation: a lens's spot also shows an eye the neighbouring views. The views are
// changed beforehand so that the light that reaches the eye is closer to the intended view.
//
// With W the weight of each view for an eye in the middle of each view, the compensated views L'
// minimise |W L' - L|^2 + e |L' - L|^2 in linear light, per pixel and colour, and are clamped to
// the panel's range. e = 0 where W is well-conditioned.
#pragma once

#include <string>
#include <vector>

#include "frames/quilt.h"

namespace lenticule::frames {

struct Crosstalk {
  /// Weights of the view itself, of each neighbour, of each second neighbour, ...: at the ends of
  /// the lobe the missing weights are distributed over the others.
  std::vector<double> shares;
  double restraint = 0.0;  ///< e
};

/// Returns a crosstalk of `percent` of the light from the two neighbours together, 0 to 40. Throws
/// Error(Usage).
[[nodiscard]] Crosstalk crosstalk_of_percent(double percent);
/// Returns the crosstalk of a Gaussian spot with sigma in views. Wide spots cannot be inverted: e =
/// 0.01 limits the amplification of noise to five times.
[[nodiscard]] Crosstalk crosstalk_of_spot(double sigma_views);

/// Limit of views, since the dense system is solved.
inline constexpr int kMostCompensatedViews = 256;

/// Returns the matrix that multiplies the views, row by row; each row sums to 1.
[[nodiscard]] std::vector<double> compensation_matrix(const Crosstalk& crosstalk, int views);

/// Returns the compensated views. Throws Error(Usage) for more than kMostCompensatedViews views.
[[nodiscard]] ViewSet compensate(const ViewSet& views, const Crosstalk& crosstalk);

}  // namespace lenticule::frames
