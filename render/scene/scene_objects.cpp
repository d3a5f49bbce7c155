// SPDX-License-Identifier: Apache-2.0
#include "render/scene/scene_objects.h"

#include <algorithm>

#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

Vec3 in_double(const Vec3f& v) {
  return {double{v.x}, double{v.y}, double{v.z}};
}

Fingerprint made_of(const Scene& scene, const MeshShape& mesh) {
  SceneMixer mixer;
  mixer.add_mesh(mesh);
  for (const uint32_t number : mesh.wide)
    if (number != MeshShape::kNotWide)
      for (const Vec3& corner : scene.wide_triangles[number].corner) mixer.add(corner);
  return mixer.value();
}

Fingerprint made_of(const Scene&, const SphereShape& sphere) {
  SceneMixer mixer;
  mixer.add_sphere(sphere);
  return mixer.value();
}

Fingerprint made_of(const Scene&, const ConeShape& cone) {
  SceneMixer mixer;
  for (const Vec3& v : {cone.base, cone.axis}) mixer.add(v);
  for (const double number : {cone.height, cone.base_radius, cone.slope}) mixer.add(number);
  mixer.add(cone.inward);
  mixer.add(cone.material);
  return mixer.value();
}

/// Returns the bounds of a mesh. The last position is padding for Embree, not a vertex.
Bounds bounds_of(const MeshShape& mesh) {
  Bounds box;
  for (size_t n = 0; n + 1 < mesh.positions.size(); ++n) box.extend(in_double(mesh.positions[n]));
  return box;
}

/// Returns the bounds of a sphere or cone.
template <class Shape>
Bounds bounds_of(const Shape& shape) {
  const Box box = box_of(shape);
  return {box.low, box.high};
}

/// Fingerprints all scene data outside the objects. The start of the rays is left out: no content
/// lies in front of it, or the camera determines it, and then it is part of the map.
Fingerprint rest_of(const Scene& scene) {
  SceneMixer mixer;
  mixer.add(scene.materials);
  mixer.add(uint64_t{scene.lights.size()});
  for (const SceneLight& light : scene.lights) mixer.add_light(light);
  const Affine& map = scene.scene_from_panel;
  for (const Vec3& v : {scene.ambient, scene.backdrop.colour, scene.backdrop.up,
                        scene.backdrop.ahead, map.column_x, map.column_y, map.column_z, map.origin})
    mixer.add(v);
  mixer.add(scene.backdrop.sky);
  mixer.add(scene.colour_managed);
  mixer.add(scene.units_per_world);
  for (const uint64_t count : {scene.meshes.size(), scene.spheres.size(), scene.cones.size()})
    mixer.add(count);
  return mixer.value();
}

}  // namespace

SceneObjects::SceneObjects(const Scene& scene)
    : known(true),
      rest(rest_of(scene)),
      textures(scene.textures),
      environment(scene.backdrop.environment) {
  objects.reserve(scene.meshes.size() + scene.spheres.size() + scene.cones.size());
  const auto add_all = [&](const auto& shapes) {
    for (const auto& shape : shapes) {
      const Material& material = scene.materials[static_cast<size_t>(shape.material)];
      objects.push_back(
          {.made_of = render::made_of(scene, shape),
           .box = bounds_of(shape),
           .depends_on_view = material.specular > 0.0 || material.transmittance > 0.0});
    }
  };
  add_all(scene.meshes);
  add_all(scene.spheres);
  add_all(scene.cones);
}

bool differ_in_objects_only(const SceneObjects& a, const SceneObjects& b) {
  return a.known && b.known && a.rest == b.rest && a.objects.size() == b.objects.size() &&
         std::ranges::equal(a.textures, b.textures, same_texture) &&
         same_texture(a.environment, b.environment);
}

}  // namespace lenticule::render
