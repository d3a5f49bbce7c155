// SPDX-License-Identifier: Apache-2.0
// Sixteen rays in all three colours, and which way their light came.
#pragma once

#include <cstdint>
#include <span>

#include "render/integrator/packet_tracer.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

/// Of one thread.
class ColourTracer {
 public:
  ColourTracer(const RenderOptions& options, const TilePlan& plan)
      : tracer_(options), plan_(plan) {}

  struct Colours {
    alignas(64) float light[3][kPacket];
    float secondary[3][kPacket];  ///< part of it: from mirrored and refracted rays
    uint32_t group[kPacket];
    PacketTracer::Notes notes;  ///< of green
  };
  /// Valid lanes of the packet, which hold afterwards what they met, see PacketTracer. Less light
  /// than `noticed` makes no difference to the notes.
  void trace(const Scene& scene, const SurfaceGroups& groups, float noticed, RayPacket& packet,
             Colours& out);

  [[nodiscard]] PacketTracer& tracer() { return tracer_; }

 private:
  PacketTracer tracer_;
  const TilePlan& plan_;
};

}  // namespace lenticule::render
