// SPDX-License-Identifier: Apache-2.0
// Packets of sixteen rays, traced in the widths that Embree supports on this machine.
#pragma once

#include "render/accel/embree.h"

namespace lenticule::render {

/// Traces a packet. `valid` is -1 in active lanes and 0 in inactive lanes, which are not changed. A
/// packet that is not in_one_octant() is traced as incoherent, regardless of `coherence`. `width`
/// is 16, 8 or 4. Thread safety: any thread.
void intersect16(const int* valid, RTCScene scene, RTCRayHit16& rays, Coherence coherence,
                 int width = widest_packet());
/// Tests a packet for occlusion: sets t_far to -infinity in occluded lanes.
void occluded16(const int* valid, RTCScene scene, RTCRay16& rays, Coherence coherence,
                int width = widest_packet());

/// Returns true if a packet may be traced as coherent. For coherent packets, Embree first
/// intersects the bounds of all rays, which it computes from the smallest and largest reciprocals
/// of the direction components. If a component has both signs, these reciprocals bound nothing, and
/// Embree can miss the whole packet (`lenticule bench stability`, rows edges and inside). Such
/// packets would not be faster as coherent packets either.
[[nodiscard]] bool in_one_octant(const int* valid, const RTCRay16& rays);

/// Returns Coherent for a packet that is in_one_octant(). Embree's two modes round distances
/// differently, and choose differently among triangles that meet at the ray. A caller that removes
/// lanes by culling chooses the mode before, so that the remaining lanes have the same hits no
/// matter which lanes are culled.
[[nodiscard]] Coherence coherence_of(const int* valid, const RTCRay16& rays);

}  // namespace lenticule::render
