// SPDX-License-Identifier: Apache-2.0
// Subpixels of a band of rows that are shaded one by one: they are collected row by row and traced
// in packets of neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/integrator/packet_tracer.h"
#include "render/methods/adaptive/light_settler.h"
#include "render/rays/tile.h"
#include "render/row_sweep/row_planes.h"

namespace lenticule::render {

/// Of one thread; keeps its memory from band to band.
class UncertainSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< of the band
    float x_mm = 0.0F, tan_x = 0.0F;
    float light = 0.0F;  ///< found by tracing
    // Only where the surface is known:
    float z_mm = 0.0F;
    uint32_t geometry = 0, primitive = 0, group = 0;
    SettledLight settled{};
  };

  /// Both must outlive it.
  UncertainSubpixels(const RowPlanes& planes, const TilePlan& plan);

  void clear() {
    subpixels_.clear();
    lamps_.clear();
  }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// One more, to be filled in place: copies of what was just written wait for it.
  [[nodiscard]] Subpixel& add() { return subpixels_.emplace_back(); }
  /// What SettledLight::lamps counts.
  [[nodiscard]] std::vector<SettledLamps>& lamps() { return lamps_; }

  /// Shades all on the surfaces that they are known to see, and traces what is not settled. Rows
  /// are counted from `first_row`; afterwards subpixels have another order. Calling thread must
  /// flush denormals.
  void shade(const Scene& scene, double start_mm, int first_row, PacketTracer& tracer);
  [[nodiscard]] const std::vector<Subpixel>& subpixels() const { return subpixels_; }

 private:
  void order();
  void find_planes(int first_row);
  void load(const Scene& scene, double start_mm, size_t first);
  void find_seeds(int first_row, size_t first);
  void load_surfaces(const Scene& scene, double start_mm, size_t first);

  const RowPlanes& planes_;
  const TilePlan& plan_;
  std::array<RowPlane, TilePlan::kRows> plane_of_row_{};  ///< of the band
  std::vector<Subpixel> subpixels_, ordered_;
  std::vector<SettledLamps> lamps_;
  std::vector<uint32_t> first_of_column_;
  std::vector<RayPacket> packet_;  ///< one
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
  PacketTracer::Known known_{};
};

}  // namespace lenticule::render
