// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/colour_offsets.h"

#include <algorithm>
#include <cmath>

namespace lenticule::calib {
namespace {

constexpr double kBgrOffset = 2.0;  ///< subpixels that red and blue are off when swapped

Estimate offset_from_green(const std::vector<ViewpointMeasurement>& viewpoints, size_t channel,
                           size_t blocks) {
  double sum = 0.0, weight = 0.0, square = 0.0;
  for (const ViewpointMeasurement& m : viewpoints) {
    const std::vector<PhaseBlock>& green = m.blocks[1].blocks;
    const std::vector<PhaseBlock>& other = m.blocks[channel].blocks;
    for (size_t n = 0; n < green.size(); ++n) {
      if (green[n].pixels == 0 || other[n].pixels == 0) continue;
      const double ahead = other[n].phase - green[n].phase;
      const double subpixels = (ahead - std::round(ahead)) * m.line.pitch_subpx();
      const double w = green[n].pixels;
      sum += w * subpixels;
      square += w * subpixels * subpixels;
      weight += w;
    }
  }
  if (!(weight > 0.0)) return {};
  const double mean = sum / weight;
  return {mean, std::sqrt(std::max(0.0, square / weight - mean * mean) /
                          std::max(1.0, static_cast<double>(blocks)))};
}

}  // namespace

ColourOffsets measure_colour_offsets(const std::vector<ViewpointMeasurement>& viewpoints,
                                     size_t blocks) {
  return {.red = offset_from_green(viewpoints, 0, blocks),
          .blue = offset_from_green(viewpoints, 2, blocks)};
}

bool are_swapped(const ColourOffsets& offsets, double pitch_subpx) {
  // Twice a subpixel in either direction: red and blue are swapped. Phases repeat after a pitch.
  const auto apart = [&](double a, double b) {
    const double turns = (a - b) / pitch_subpx;
    return std::abs(turns - std::round(turns)) * pitch_subpx;
  };
  return apart(offsets.red.value, kBgrOffset) < 0.6 &&
         apart(offsets.blue.value, -kBgrOffset) < 0.6 && apart(offsets.red.value, 0.0) > 0.6;
}

}  // namespace lenticule::calib
