// SPDX-License-Identifier: Apache-2.0
// ColourTracer traces sixteen rays in all three colours and records the paths of their light.
#pragma once

#include <cstdint>
#include <span>

#include "render/integrator/noting_tracer.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {

/// ColourTracer belongs to one thread.
class ColourTracer {
 public:
  ColourTracer(const RenderOptions& options, const TilePlan& plan)
      : tracer_(options), plan_(plan) {}

  struct Colours {
    alignas(64) float light[3][kPacket];
    float secondary[3][kPacket];  ///< part of `light` from mirrored and refracted rays
    uint32_t group[kPacket];
    LightNotes notes;  ///< path records of the green channel
  };
  /// Traces the valid lanes of the packet, which holds the hits afterwards, see NotingTracer. Light
  /// below `noticed` does not affect the notes.
  void trace(const Scene& scene, const SurfaceGroups& groups, float noticed, RayPacket& packet,
             Colours& out);

  [[nodiscard]] NotingTracer& tracer() { return tracer_; }

 private:
  NotingTracer tracer_;
  const TilePlan& plan_;
};

}  // namespace lenticule::render
