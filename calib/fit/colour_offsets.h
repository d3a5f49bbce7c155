// SPDX-License-Identifier: Apache-2.0
// Measures how far the panel's red and blue subpixels are from where its layout places them.
#pragma once

#include <vector>

#include "calib/calibration.h"
#include "calib/measure/viewpoint.h"

namespace lenticule::calib {

/// ColourOffsets holds the mean phases by which the fringes of red and blue are ahead of green's,
/// in subpixels.
struct ColourOffsets {
  Estimate red;
  Estimate blue;
};

/// Returns the offsets, means over all viewpoints. The standard errors are those of means of
/// `blocks` independent values.
[[nodiscard]] ColourOffsets measure_colour_offsets(
    const std::vector<ViewpointMeasurement>& viewpoints, size_t blocks);

/// Returns true if red and blue are swapped: the subpixels are ordered BGR.
[[nodiscard]] bool are_swapped(const ColourOffsets& offsets, double pitch_subpx);

}  // namespace lenticule::calib
