// SPDX-License-Identifier: Apache-2.0
// The subpixels of a band that the audit drew, each traced as method full traces it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/integrator/packet_tracer.h"
#include "render/methods/adaptive/audit.h"
#include "render/rays/primary_packets.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// Of one thread; keeps its memory from band to band. Mirrors that are mirrored in mirrors make a
/// different picture of a ray that differs in its last bit: so rays come from where method full
/// has them, and what a ray brings does not depend on those that are traced with it.
class DrawnSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< of the band
    Draw draw = Draw::None;
    float light = 0.0F;  ///< found by tracing
  };

  /// All must outlive it. `centre`: of the subpixels.
  DrawnSubpixels(const PrimaryPackets& packets, const TilePlan& plan, const Footprint& centre);

  void clear() { subpixels_.clear(); }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// `first_row` is that of the band; afterwards subpixels have another order. Calling thread must
  /// flush denormals.
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
  std::vector<RayPacket> packet_;  ///< one
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
};

}  // namespace lenticule::render
