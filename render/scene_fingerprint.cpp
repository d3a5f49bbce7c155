// SPDX-License-Identifier: Apache-2.0
#include "render/scene_fingerprint.h"

#include <functional>

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
  void add(const std::string& text) { add(uint64_t{std::hash<std::string>{}(text)}); }
  template <class T, size_t N>
  void add(const std::array<T, N>& values) {
    for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::optional<T>& value) {
    add(value.has_value());
    if (value) add(*value);
  }
  /// The length tells lists apart that follow each other.
  template <class T>
  void add(const std::vector<T>& values) {
    add(uint64_t{values.size()});
    for (const T& value : values) add(value);
  }

  void add(const Material& m) {
    add(m.colour);
    add(m.diffuse);
    add(m.specular);
    add(m.shine);
    add(m.transmittance);
    add(m.refraction_index);
    add(m.emission);
    add(m.tinted_specular);
    add(m.texture);
  }
  void add(const TriangleMesh& mesh) {
    add(mesh.material);
    add(mesh.positions);
    add(mesh.triangles);
    add(mesh.normals);
    add(mesh.uvs);
  }
  void add(const Sphere& sphere) {
    add(sphere.centre);
    add(sphere.radius);
    add(sphere.inward);
    add(sphere.material);
  }
  void add(const Cone& cone) {
    add(cone.base);
    add(cone.base_radius);
    add(cone.apex);
    add(cone.apex_radius);
    add(cone.inward);
    add(cone.material);
  }
  void add(const Light& light) {
    add(static_cast<int>(light.kind));
    add(light.position);
    add(light.direction);
    add(light.colour);
    add(light.falls_off);
    add(light.cos_inner);
    add(light.cos_outer);
  }
};

}  // namespace

Fingerprint scene_fingerprint(const SceneDescription& scene, const Surroundings& surroundings,
                              const Stage& stage) {
  Mixer mixer;
  mixer.add(scene.materials);
  mixer.add(scene.meshes);
  mixer.add(scene.spheres);
  mixer.add(scene.cones);
  mixer.add(scene.lights);
  mixer.add(scene.background);
  mixer.add(scene.ambient);
  mixer.add(scene.colour_managed);
  mixer.add(surroundings.background);
  mixer.add(surroundings.sky);
  mixer.add(surroundings.environment_file);
  mixer.add(surroundings.ground);
  mixer.add(surroundings.ground_colour);
  if (scene.lights.empty() && !scene.ambient) {
    mixer.add(stage.world_from_panel.column_x);
    mixer.add(stage.world_from_panel.column_z);
  }
  return mixer.value();
}

Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage) {
  Mixer mixer;
  mixer.add(scene.first);
  mixer.add(scene.second);
  const Affine& map = stage.world_from_panel;
  for (const Vec3& column : {map.column_x, map.column_y, map.column_z, map.origin})
    mixer.add(column);
  mixer.add(stage.near_mm);
  return mixer.value();
}

}  // namespace lenticule::render
