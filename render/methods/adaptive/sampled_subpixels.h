// SPDX-License-Identifier: Apache-2.0
// SampledSubpixels holds the subpixels of a band that the audit samples, and traces them as method
// full does.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/integrator/packet_tracer.h"
#include "render/methods/adaptive/audit.h"
#include "render/rays/primary_packets.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// SampledSubpixels belongs to one thread and keeps its memory from band to band. A ray that
/// differs in its last bit can give a different picture after several reflections. So rays are the
/// same as in method full, and the light of a ray does not depend on the other rays of its packet.
class SampledSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< index in the band
    Draw draw = Draw::None;
    bool is_shaded = false;  ///< not looked up
    float light = 0.0F;      ///< result of tracing
  };

  /// Lifetime: all arguments must outlive the object. `centre` is the centre of the subpixels.
  SampledSubpixels(const PrimaryPackets& packets, const TilePlan& plan, const Footprint& centre);

  void clear() { subpixels_.clear(); }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// Traces all subpixels of the band that begins at `first_row`. Afterwards the subpixels have a
  /// different order. The calling thread must flush denormals.
  void trace(const Scene& scene, int first_row, PacketTracer& tracer);
  [[nodiscard]] const std::vector<Subpixel>& subpixels() const { return subpixels_; }

 private:
  [[nodiscard]] int column(const Subpixel& s) const { return s.at + plan_.shift(s.row); }
  void trace_packet(const Scene& scene, int first_row, size_t first, size_t end,
                    PacketTracer& tracer);

  const TilePlan& plan_;
  const Footprint& centre_;
  PrimaryPackets::Maker maker_;
  std::vector<Subpixel> subpixels_;
  std::vector<RayPacket> packet_;  ///< a single packet
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
};

}  // namespace lenticule::render
