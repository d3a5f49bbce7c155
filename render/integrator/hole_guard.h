// SPDX-License-Identifier: Apache-2.0
// Crack filter: finds and fills the pinholes that single precision leaves at the corners of meshes.
//
// Embree decides consistently which of two triangles with a common edge a ray hits. Where many
// triangles meet in a corner, a ray that passes exactly through the corner can miss all of them.
#pragma once

#include "render/accel/ray_stream.h"
#include "render/options/render_statistics.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Examines a packet of neighbouring rays that Embree has just traced, and repairs the hits of rays
/// that passed through a pinhole. A ray is examined if it continues past the hits of its
/// neighbours. Four rays at a tiny distance around it are traced, and all must end much sooner than
/// the ray. The ray gets its own hit if it ends as soon when traced alone; otherwise the hit of one
/// of the four, if it passes a corner within the rounding of single precision. The result depends
/// on the packet and the scene only. Counts suspected and filled holes.
///
/// `step_mm` is the distance between neighbouring rays. The calling thread must flush denormals.
void fill_holes(const Scene& scene, double step_mm, RayPacket& packet, FrameCounts& counts);

}  // namespace lenticule::render
