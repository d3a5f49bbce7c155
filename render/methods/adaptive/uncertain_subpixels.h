// SPDX-License-Identifier: Apache-2.0
// UncertainSubpixels collects the subpixels of a band of rows that must be shaded individually, row
// by row, and traces them in packets of neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/integrator/noting_tracer.h"
#include "render/methods/adaptive/light_resolver.h"
#include "render/rays/tile.h"
#include "render/row_sweep/row_planes.h"

namespace lenticule::render {

/// UncertainSubpixels belongs to one thread and keeps its memory from band to band.
class UncertainSubpixels {
 public:
  struct Subpixel {
    int32_t at = 0;    ///< 3 i + channel
    uint16_t row = 0;  ///< index in the band
    float x_mm = 0.0F, tan_x = 0.0F;
    float light = 0.0F;  ///< result of tracing
    // Valid only if the surface is known:
    float z_mm = 0.0F;
    uint32_t geometry = 0, primitive = 0, group = 0;
    ResolvedLight resolved{};
  };

  /// Lifetime: `planes` and `plan` must outlive the object.
  UncertainSubpixels(const RowPlanes& planes, const TilePlan& plan);

  void clear() {
    subpixels_.clear();
    area_lights_.clear();
  }
  void add(const Subpixel& subpixel) { subpixels_.push_back(subpixel); }
  /// Adds a subpixel to be filled in place, since a copy would stall on recent writes.
  [[nodiscard]] Subpixel& add() { return subpixels_.emplace_back(); }
  /// Returns the list that ResolvedLight::area_lights indexes.
  [[nodiscard]] std::vector<ResolvedAreaLights>& area_lights() { return area_lights_; }

  /// Shades all subpixels on their known surfaces, and traces the light that is not resolved. Rows
  /// are counted from `first_row`. Afterwards the subpixels have a different order. The calling
  /// thread must flush denormals.
  void shade(const Scene& scene, double start_mm, int first_row, NotingTracer& tracer);
  [[nodiscard]] const std::vector<Subpixel>& subpixels() const { return subpixels_; }

 private:
  void order();
  void find_planes(int first_row);
  void load(const Scene& scene, double start_mm, size_t first);
  void find_seeds(int first_row, size_t first);
  void load_surfaces(const Scene& scene, double start_mm, size_t first);

  const RowPlanes& planes_;
  const TilePlan& plan_;
  std::array<RowPlane, TilePlan::kRows> plane_of_row_{};  ///< plane of each row of the band
  std::vector<Subpixel> subpixels_, ordered_;
  std::vector<ResolvedAreaLights> area_lights_;
  std::vector<uint32_t> first_of_column_;
  std::vector<RayPacket> packet_;  ///< a single packet
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
  KnownLight known_{};
};

}  // namespace lenticule::render
