// SPDX-License-Identifier: Apache-2.0
#include "render/adaptive/scene_things.h"

#include <algorithm>

#include "render/texture.h"

namespace lenticule::render {
namespace {

class Mixer : public WordMixer {
 public:
  using WordMixer::add;
  void add(const Vec3& v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  void add(const Vec3f& v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  template <class T, size_t N>
  void add(const std::array<T, N>& values) {
    for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(uint64_t{values.size()});
    for (const T& value : values) add(value);
  }
};

Vec3 in_double(const Vec3f& v) {
  return {double{v.x}, double{v.y}, double{v.z}};
}

Fingerprint made_of(const MeshShape& mesh) {
  Mixer mixer;
  mixer.add(mesh.material);
  mixer.add(mesh.positions);
  mixer.add(mesh.triangles);
  mixer.add(mesh.normals);
  mixer.add(mesh.uvs);
  return mixer.value();
}

Fingerprint made_of(const SphereShape& sphere) {
  Mixer mixer;
  mixer.add(sphere.centre);
  mixer.add(sphere.radius);
  mixer.add(sphere.inward);
  mixer.add(sphere.material);
  return mixer.value();
}

Fingerprint made_of(const ConeShape& cone) {
  Mixer mixer;
  for (const Vec3& v : {cone.base, cone.axis}) mixer.add(v);
  for (const double number : {cone.height, cone.base_radius, cone.slope}) mixer.add(number);
  mixer.add(cone.inward);
  mixer.add(cone.material);
  return mixer.value();
}

/// The last position is only there for Embree to read past.
Bounds bounds_of(const MeshShape& mesh) {
  Bounds box;
  for (size_t n = 0; n + 1 < mesh.positions.size(); ++n) box.extend(in_double(mesh.positions[n]));
  return box;
}

/// Of spheres and cones.
template <class Shape>
Bounds bounds_of(const Shape& shape) {
  const Box box = box_of(shape);
  return {box.low, box.high};
}

void add_material(Mixer& mixer, const Material& material) {
  for (const Vec3& colour : {material.colour, material.emission}) mixer.add(colour);
  for (const double number : {material.diffuse, material.specular, material.shine,
                              material.transmittance, material.refraction_index})
    mixer.add(number);
  mixer.add(material.tinted_specular);
  mixer.add(material.two_sided);
  mixer.add(material.texture);
}

void add_light(Mixer& mixer, const SceneLight& light) {
  mixer.add(static_cast<int>(light.kind));
  for (const Vec3& v : {light.position, light.direction, light.colour}) mixer.add(v);
  mixer.add(light.falls_off);
  mixer.add(light.cos_inner);
  mixer.add(light.cos_outer);
}

/// Where rays start is left out: nothing is before it, or the camera says so, which is in the map.
Fingerprint rest_of(const Scene::Impl& scene) {
  Mixer mixer;
  mixer.add(uint64_t{scene.materials.size()});
  for (const Material& material : scene.materials) add_material(mixer, material);
  mixer.add(uint64_t{scene.lights.size()});
  for (const SceneLight& light : scene.lights) add_light(mixer, light);
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

SceneThings::SceneThings(const Scene::Impl& scene)
    : known(true),
      rest(rest_of(scene)),
      textures(scene.textures),
      environment(scene.backdrop.environment) {
  things.reserve(scene.meshes.size() + scene.spheres.size() + scene.cones.size());
  const auto add_all = [&](const auto& shapes) {
    for (const auto& shape : shapes) {
      const Material& material = scene.materials[static_cast<size_t>(shape.material)];
      things.push_back(
          {.made_of = render::made_of(shape),
           .box = bounds_of(shape),
           .depends_on_view = material.specular > 0.0 || material.transmittance > 0.0});
    }
  };
  add_all(scene.meshes);
  add_all(scene.spheres);
  add_all(scene.cones);
}

bool differ_in_things_only(const SceneThings& a, const SceneThings& b) {
  return a.known && b.known && a.rest == b.rest && a.things.size() == b.things.size() &&
         std::ranges::equal(a.textures, b.textures, same_texture) &&
         same_texture(a.environment, b.environment);
}

}  // namespace lenticule::render
