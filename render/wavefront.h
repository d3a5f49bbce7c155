// SPDX-License-Identifier: Apache-2.0
// Follows the rays of a tile through the scene, one generation at a time, so that every generation
// and every light can be traced in packets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/committed_scene.h"
#include "render/primary_packets.h"
#include "render/ray_stream.h"
#include "render/surface.h"

namespace lenticule::render {

struct RayCounts {
  uint64_t primary = 0;
  uint64_t secondary = 0;
  uint64_t shadow = 0;
  uint64_t invalid = 0;

  RayCounts& operator+=(const RayCounts& other);
};

/// Scratch of one thread; keeps its memory from tile to tile.
class Wavefront {
 public:
  /// Adds to light[target] what the primary rays of the tile that `maker` was started with bring,
  /// each `weight` times; a ray's target is its row * columns + column. Everything is added in an
  /// order that depends on the rays alone. Calling thread must flush denormals.
  void trace(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile, int max_depth,
             double weight, PrimaryPackets::Maker& maker, std::span<double> light,
             RayCounts& counts);

 private:
  struct Visit {
    const PathRay* ray;
    Surface surface;
  };

  void trace_primary(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile,
                     double weight, PrimaryPackets::Maker& maker, std::span<double> light,
                     RayCounts& counts);
  void sort_primary(const Scene::Impl& scene, const TilePlan& plan, const Tile& tile, int column,
                    double weight, const RayPacket& packet, std::span<double> light,
                    RayCounts& counts);
  void visit_surfaces(const Scene::Impl& scene, std::span<double> light);
  void add_lights(const Scene::Impl& scene, std::span<double> light, RayCounts& counts);
  void continue_rays();

  std::vector<RayPacket> packets_;
  std::vector<Hit> hits_;
  std::vector<Visit> visits_;
  std::vector<ShadowRay> shadow_rays_;
  std::vector<PathRay> generation_;  ///< with hits_, the rays being followed
  std::vector<PathRay> next_;
};

}  // namespace lenticule::render
