// SPDX-License-Identifier: Apache-2.0
// Finds out from the marks whether camera or panel moved between two pictures of one place.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::calib {

/// Movement of the marks, in camera pixels, from which on a place counts as knocked. Good
/// sequences have steps of 0.02 to 0.06.
inline constexpr double kKnockPx = 0.25;

/// MarkStep is a lasting change of the marks' place.
struct MarkStep {
  size_t picture = 0;  ///< number, from 0, of the first picture after the step
  double length_px = 0.0;
};

/// Returns the largest step above kKnockPx. Takes MarkReader::moved of each picture, in their
/// order. A step needs four pictures on each side: single readings vary with the light around the
/// marks, but medians of many do not.
[[nodiscard]] std::optional<MarkStep> find_step(const std::vector<Vec2>& moves);

/// Returns "the camera moved between photograph A and B", numbers from 1; `picture` as in MarkStep.
[[nodiscard]] std::string moved_between(size_t picture);

}  // namespace lenticule::calib
