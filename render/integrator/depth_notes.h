// SPDX-License-Identifier: Apache-2.0
// How deep the primary rays of a tile end.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Of one thread and one scene.
class DepthNotes {
 public:
  explicit DepthNotes(const Scene& scene);

  /// Begins a tile: nothing is met anywhere.
  void start(const Tile& tile);
  /// A column's packet, as Embree left it.
  void note(int column, const RayPacket& packet);

  /// Panel z by row * columns + column, millimetres; -infinity where nothing is met.
  [[nodiscard]] std::span<const float> z_mm() const { return z_mm_; }

 private:
  Vec3f z_of_scene_;  ///< gradient and origin of panel z in the scene frame
  float z_at_origin_;
  size_t columns_ = 0;
  std::vector<float> z_mm_;
};

}  // namespace lenticule::render
