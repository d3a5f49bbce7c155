// SPDX-License-Identifier: Apache-2.0
// NotingTracer traces packets for method adaptive: it records how their light came about, and
// shades packets whose light is partly known.
#pragma once

#include <cstdint>
#include <span>

#include "render/integrator/light_memory.h"
#include "render/integrator/packet_tracer.h"

namespace lenticule::render {

/// NotingTracer is a PacketTracer with a LightMemory. Thread safety: used by one thread.
class NotingTracer : public PacketTracer {
 public:
  using PacketTracer::PacketTracer;

  /// Traces like trace_lanes(), fills notes() with the path records of the lanes, and stores all
  /// hits for trace_known(). Light below `noticed` does not affect the records.
  void trace_noting(const Scene& scene, const TilePlan& plan,
                    std::span<const int32_t, kPacket> channel, const SurfaceGroups& groups,
                    float noticed, RayPacket& packet, std::span<float, kPacket> light) {
    memory_.begin_noting(groups, noticed);
    use(&memory_);
    trace_lanes(scene, plan, channel, packet, light);
    use(nullptr);
    memory_.end(light.data());
  }
  /// Returns the records of the last trace_noting().
  [[nodiscard]] const LightNotes& notes() const { return memory_.notes(); }

  /// Shades like trace_lanes() a packet that already holds the hits of its primary rays. Shading is
  /// exact; `known` saves rays. Afterwards notes().secondary is valid, all other notes are not.
  /// `again` states that the packet is that of the last trace_noting() in another colour, so that
  /// its rays have the same hits.
  void trace_known(const Scene& scene, const TilePlan& plan,
                   std::span<const int32_t, kPacket> channel, const KnownLight& known,
                   const RayPacket& packet, std::span<float, kPacket> light, bool again = false) {
    memory_.begin_known(known, again);
    use(&memory_);
    shade_lanes(scene, plan, channel, packet, light);
    use(nullptr);
    memory_.end(light.data());
  }
  using PacketTracer::pbr_light;

 private:
  LightMemory memory_;
};

}  // namespace lenticule::render
