// SPDX-License-Identifier: Apache-2.0
// Reads any text as a scene: the result is an Error, or a scene that can be traced.
#include <cmath>
#include <cstdint>
#include <string_view>

#include "base/error.h"
#include "render/loaders/nff.h"

namespace {

using lenticule::is_finite;
using namespace lenticule::render;

void check_material(const SceneDescription& scene, int material) {
  LENTICULE_CHECK(material >= 0 && static_cast<size_t>(material) < scene.materials.size());
}

void check_mesh(const SceneDescription& scene, const TriangleMesh& mesh) {
  check_material(scene, mesh.material);
  LENTICULE_CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions.size());
  for (const auto& p : mesh.positions) LENTICULE_CHECK(is_finite(p));
  for (const auto& n : mesh.normals) LENTICULE_CHECK(std::abs(dot(n, n) - 1.0) < 1e-5);
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t corner : triangle) LENTICULE_CHECK(corner < mesh.positions.size());
}

void check_scene(const SceneDescription& scene) {
  for (const TriangleMesh& mesh : scene.meshes) check_mesh(scene, mesh);
  for (const Sphere& s : scene.spheres) {
    check_material(scene, s.material);
    LENTICULE_CHECK(is_finite(s.centre) && std::isfinite(s.radius) && s.radius > 0.0);
  }
  for (const Cone& c : scene.cones) {
    check_material(scene, c.material);
    LENTICULE_CHECK(is_finite(c.base) && is_finite(c.apex) && !(c.base == c.apex));
    LENTICULE_CHECK(c.base_radius >= 0.0 && c.apex_radius >= 0.0);
  }
  for (const Light& light : scene.lights)
    LENTICULE_CHECK(is_finite(light.position) && is_finite(light.colour));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    check_scene(parse_nff({reinterpret_cast<const char*>(data), size}, "fuzz"));
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Input);
  }
  return 0;
}
