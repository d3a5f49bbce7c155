// SPDX-License-Identifier: Apache-2.0
// SurfaceGroups finds the primitives that form one smooth surface. Shading has no edges inside a
// smooth surface.
#pragma once

#include <cstdint>
#include <vector>

#include "render/scene/scene.h"

namespace lenticule::render {

/// SurfaceGroups assigns a group to every primitive. Two triangles of a mesh belong to one group if
/// they share an edge and the shading normals at both its ends; without shading normals, if they
/// lie in one plane. Every sphere and every cone is a group. Thread safety: immutable after
/// construction, usable from any thread.
class SurfaceGroups {
 public:
  static constexpr uint32_t kNothing = 0;  ///< the group of no surface

  explicit SurfaceGroups(const Scene& scene);

  /// Returns the group of a primitive, given Embree's geometry and primitive numbers. It is odd if
  /// the colour of a surface point may depend on the viewpoint: the surface is reflective, has
  /// highlights or is transparent.
  [[nodiscard]] uint32_t of(uint32_t geometry, uint32_t primitive) const {
    return groups_[first_[geometry] + primitive];
  }
  [[nodiscard]] static constexpr bool lets_light_through(uint32_t group) {
    return (group & 2U) != 0;
  }
  friend bool operator==(const SurfaceGroups&, const SurfaceGroups&) = default;

 private:
  void add_mesh(const Scene& scene, const MeshShape& mesh);
  void add(const Scene& scene, int material);

  std::vector<size_t> first_;  ///< first element per geometry
  std::vector<uint32_t> groups_;
  uint32_t count_ = 0;
};

}  // namespace lenticule::render
