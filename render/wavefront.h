// SPDX-License-Identifier: Apache-2.0
// Follows the rays of a tile through the scene, one generation at a time, so that every generation
// and every light can be traced in packets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/committed_scene.h"
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
  /// Adds to light[target] what each of the rays brings. Everything is added in an order that
  /// depends on the rays alone. Calling thread must flush denormals.
  void trace(const Scene::Impl& scene, int max_depth, std::span<const PathRay> rays,
             std::span<double> light, RayCounts& counts);

 private:
  struct Visit {
    const PathRay* ray;
    Surface surface;
  };

  void visit_surfaces(const Scene::Impl& scene, std::span<const PathRay> rays,
                      std::span<double> light);
  void add_lights(const Scene::Impl& scene, std::span<double> light, RayCounts& counts);
  void continue_rays();

  std::vector<Hit> hits_;
  std::vector<Visit> visits_;
  std::vector<ShadowRay> shadow_rays_;
  std::vector<PathRay> generation_;
  std::vector<PathRay> next_;
};

}  // namespace lenticule::render
