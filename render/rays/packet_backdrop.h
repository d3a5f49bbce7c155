// SPDX-License-Identifier: Apache-2.0
// Light of the backdrop that the rays of a packet see.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "render/accel/ray_stream.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// Computes light_beyond() of the rays in `lanes` (bit r for lane r), each in its channel; other
/// elements of the result are unspecified. A ray's result does not depend on the other lanes.
void light_beyond_packet(const Backdrop& backdrop, const RayPacket& packet, uint32_t lanes,
                         std::span<const int32_t, kPacket> channel,
                         std::array<float, kPacket>& out);

}  // namespace lenticule::render
