// SPDX-License-Identifier: Apache-2.0
// Which primitives belong to one smooth surface: on it, shading has no edges of its own.
#pragma once

#include <cstdint>
#include <vector>

#include "render/scene/scene.h"

namespace lenticule::render {

/// Triangles of a mesh are one surface where they share an edge and, in both its corners, the
/// shading normal; without such normals where they lie in one plane. Every sphere and cone is one.
/// Immutable after construction, for any thread.
class SurfaceGroups {
 public:
  static constexpr uint32_t kNothing = 0;  ///< the group of no surface

  explicit SurfaceGroups(const Scene& scene);

  /// Embree's numbers.
  [[nodiscard]] uint32_t of(uint32_t geometry, uint32_t primitive) const {
    return groups_[first_[geometry] + primitive];
  }
  /// Whether a point of the surface may look different from different places: it mirrors, shines or
  /// lets light through.
  [[nodiscard]] static constexpr bool depends_on_view(uint32_t group) { return (group & 1U) != 0; }
  [[nodiscard]] static constexpr bool lets_light_through(uint32_t group) {
    return (group & 2U) != 0;
  }
  friend bool operator==(const SurfaceGroups&, const SurfaceGroups&) = default;

 private:
  void add_mesh(const Scene& scene, const MeshShape& mesh);
  void add(const Scene& scene, int material);

  std::vector<size_t> first_;  ///< by geometry
  std::vector<uint32_t> groups_;
  uint32_t count_ = 0;
};

}  // namespace lenticule::render
