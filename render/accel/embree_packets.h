// SPDX-License-Identifier: Apache-2.0
// Packets of sixteen rays, in widths that Embree traces together on this machine.
#pragma once

#include "render/accel/embree.h"

namespace lenticule::render {

/// Lanes where `valid` is 0 stay as they are; it is -1 in the others. Packets that may not be
/// traced as coherent ones are not, whatever `coherence` says. `width` is 16, 8 or 4. Any thread.
void intersect16(const int* valid, RTCScene scene, RTCRayHit16& rays, Coherence coherence,
                 int width = widest_packet());
/// t_far becomes -infinity where something is in the way.
void occluded16(const int* valid, RTCScene scene, RTCRay16& rays, Coherence coherence,
                int width = widest_packet());

/// Whether a packet may be traced as a coherent one. Embree then asks first what the bounds of all
/// its rays meet, which it makes from the smallest and the largest reciprocal of the directions'
/// components. Where these have both signs they bound nothing, and the whole packet can be lost
/// (`lenticule bench stability`, rows edges and inside). Such packets gain nothing there either.
[[nodiscard]] bool in_one_octant(const int* valid, const RTCRay16& rays);

}  // namespace lenticule::render
