// SPDX-License-Identifier: Apache-2.0
// DepthNotes records the depths at which the primary rays of a tile end.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "render/accel/ray_stream.h"
#include "render/rays/tile.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// DepthNotes records depths for one scene. Thread safety: used by one thread.
class DepthNotes {
 public:
  explicit DepthNotes(const Scene& scene);

  /// Begins a tile; all depths are reset to -infinity.
  void start(const Tile& tile);
  /// Records the hits of a column's packet after tracing.
  void note(int column, const RayPacket& packet);

  /// Returns panel z by row * columns + column, in millimetres; -infinity for rays that met
  /// nothing.
  [[nodiscard]] std::span<const float> z_mm() const { return z_mm_; }

 private:
  Vec3f z_of_scene_;  ///< gradient and origin of panel z in the scene frame
  float z_at_origin_;
  size_t columns_ = 0;
  std::vector<float> z_mm_;
};

}  // namespace lenticule::render
