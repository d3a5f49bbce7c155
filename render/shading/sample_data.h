// SPDX-License-Identifier: Apache-2.0
// Sample points as the shading kernel reads them; render/shading/sample_set.h makes them. Plain
// data only, see render/shading/shading_kernel.h.
#pragma once

#include <cstdint>

namespace lenticule::render::sampling {

/// How the points of sixteen lanes are scrambled, in each dimension.
struct alignas(64) SampleSet {
  uint32_t scramble[2][16];
};

/// One point of each lane's set.
struct Sample {
  const SampleSet* set;
  uint32_t x, y;  ///< before scrambling, with their bits in reverse order
};

}  // namespace lenticule::render::sampling
