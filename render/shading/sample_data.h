// SPDX-License-Identifier: Apache-2.0
// Sample points in the form that the shading kernel reads; render/shading/sample_set.h makes them.
// Plain data only, see render/shading/shading_kernel.h.
#pragma once

#include <cstdint>

namespace lenticule::render::sampling {

/// SampleSet holds the scrambling seeds of the points of sixteen lanes, per dimension.
struct alignas(64) SampleSet {
  uint32_t scramble[2][16];
};

/// Sample is one point of each lane's set.
struct Sample {
  const SampleSet* set;
  uint32_t x, y;  ///< before scrambling, with the bits in reverse order
};

}  // namespace lenticule::render::sampling
