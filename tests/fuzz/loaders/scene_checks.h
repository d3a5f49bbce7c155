// SPDX-License-Identifier: Apache-2.0
// Checks what every loader must guarantee about a scene, whatever file it read.
#pragma once

#include <cmath>

#include "base/error.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

inline void check_material(const SceneDescription& scene, int material) {
  LENTICULE_CHECK(material >= 0 && static_cast<size_t>(material) < scene.materials.size());
}

template <class T>
void check_per_vertex(const TriangleMesh& mesh, const std::vector<T>& values) {
  LENTICULE_CHECK(values.empty() || values.size() == mesh.positions.size());
}

inline void check_mesh(const SceneDescription& scene, const TriangleMesh& mesh) {
  check_material(scene, mesh.material);
  check_per_vertex(mesh, mesh.normals);
  check_per_vertex(mesh, mesh.uvs);
  check_per_vertex(mesh, mesh.uvs2);
  check_per_vertex(mesh, mesh.colours);
  check_per_vertex(mesh, mesh.tangents);
  for (const auto& p : mesh.positions) LENTICULE_CHECK(is_finite(p));
  for (const auto& n : mesh.normals) LENTICULE_CHECK(std::abs(dot(n, n) - 1.0) < 1e-5);
  for (const auto& t : mesh.tangents)
    LENTICULE_CHECK(std::isfinite(t[0]) && std::isfinite(t[1]) && std::isfinite(t[2]) &&
                    std::abs(t[3]) == 1.0F);
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t corner : triangle) LENTICULE_CHECK(corner < mesh.positions.size());
}

/// Aborts if a scene without nodes has an index out of range or a number that is not finite.
inline void check_scene(const SceneDescription& scene) {
  for_each_mesh(scene, [&](const TriangleMesh& mesh) { check_mesh(scene, mesh); });
  for (const Sphere& s : scene.spheres) {
    check_material(scene, s.material);
    LENTICULE_CHECK(is_finite(s.centre) && std::isfinite(s.radius) && s.radius > 0.0);
  }
  for (const Cone& c : scene.cones) {
    check_material(scene, c.material);
    LENTICULE_CHECK(is_finite(c.base) && is_finite(c.apex) && !(c.base == c.apex));
    LENTICULE_CHECK(c.base_radius >= 0.0 && c.apex_radius >= 0.0);
  }
  for (const Material& material : scene.materials)
    LENTICULE_CHECK(material.texture < static_cast<int>(scene.textures.size()));
  for (const Light& light : scene.lights)
    LENTICULE_CHECK(is_finite(light.position) && is_finite(light.colour));
}

}  // namespace lenticule::render
