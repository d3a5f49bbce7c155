// SPDX-License-Identifier: Apache-2.0
// Finds and fills the pinholes that single precision leaves at corners of meshes.
//
// Two triangles that share an edge agree about which of them a ray meets. Where many triangles meet
// in a corner, a ray that goes through it to the last bit can be outside all of them.
#pragma once

#include <cstdint>

#include "render/accel/ray_stream.h"
#include "render/scene/scene.h"

namespace lenticule::render {

struct HoleCounts {
  uint64_t suspected = 0;  ///< rays of which a second look was taken
  uint64_t filled = 0;     ///< and those that had slipped through

  HoleCounts& operator+=(const HoleCounts& other) {
    suspected += other.suspected;
    filled += other.filled;
    return *this;
  }
};

/// Looks at a packet of neighbouring rays that Embree has just traced. A ray that goes on where its
/// neighbours end is looked at once more: it slipped through a corner if it passes one within the
/// rounding of single precision and if all rays a hair beside it, on four sides, end much sooner.
/// It then gets what one of those met. Depends on the packet and the scene alone.
///
/// `step_mm` is what neighbouring rays are apart. Calling thread must flush denormals.
void fill_holes(const Scene& scene, double step_mm, RayPacket& packet, HoleCounts& counts);

}  // namespace lenticule::render
