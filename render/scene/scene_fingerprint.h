// SPDX-License-Identifier: Apache-2.0
// Fingerprints that detect if two frames show the same scene.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/scene/scene_description.h"
#include "render/scene/stage.h"
#include "render/scene/surroundings.h"

namespace lenticule::render {

/// A 128-bit fingerprint: two independent 64-bit hashes of the same words. Equal fingerprints are
/// taken as equal content.
struct Fingerprint {
  uint64_t first = 0;
  uint64_t second = 0;
  friend bool operator==(const Fingerprint&, const Fingerprint&) = default;
};

/// SceneMixer computes a Fingerprint from a sequence of words. The order of the words matters.
class SceneMixer {
 public:
  void add(uint64_t word) {
    value_.first = std::rotl(value_.first ^ word, 29) * 0x9E3779B97F4A7C15U;
    value_.first ^= value_.first >> 32;
    value_.second = (std::rotl(value_.second, 31) + word) * 0xC2B2AE3D27D4EB4FU;
    value_.second ^= value_.second >> 29;
  }
  void add(double number) { add(std::bit_cast<uint64_t>(number)); }
  void add(float number) { add(uint64_t{std::bit_cast<uint32_t>(number)}); }
  void add(bool flag) { add(uint64_t{flag}); }
  void add(int number) { add(static_cast<uint64_t>(number)); }
  void add(uint32_t number) { add(uint64_t{number}); }

  template <class First, class Second, class... More>
  void add(const First& first, const Second& second, const More&... more) {
    add(first);
    add(second);
    (add(more), ...);
  }
  template <class T>
  void add(const Vec3T<T>& v) {
    add(v.x, v.y, v.z);
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
  /// Mixes the length first, so that the boundary between consecutive lists matters.
  template <class T>
  void add(const std::vector<T>& values) {
    add(uint64_t{values.size()});
    for (const T& value : values) add(value);
  }

  void add(const Material& m) {
    add(m.colour, m.diffuse, m.specular, m.shine, m.transmittance, m.refraction_index, m.emission,
        m.tinted_specular, m.texture, m.pbr != nullptr);
    if (m.pbr) add(*m.pbr);
  }
  void add(const TextureUse& use) { add(use.texture, use.uv_set, use.uv_map); }
  void add(const PbrMaterial& m) {
    add(static_cast<int>(m.alpha_mode), m.double_sided, m.unlit);
    for (const auto number : kPbrNumbers) add(m.*number);
    for (const auto colour : kPbrColours) add(m.*colour);
    for (const auto use : kPbrTextures) add(m.*use);
  }
  void add(const Affine& map) { add(map.column_x, map.column_y, map.column_z, map.origin); }
  void add(const std::shared_ptr<const TriangleMesh>& shape) { add(*shape); }
  void add(const TriangleMesh& mesh) {
    add_mesh(mesh);
    add(mesh.shape, mesh.place);
  }
  void add(const Sphere& sphere) { add_sphere(sphere); }
  void add(const Cone& cone) {
    add(cone.base, cone.base_radius, cone.apex, cone.apex_radius, cone.inward, cone.material);
  }
  void add(const Light& light) {
    add(static_cast<int>(light.kind), light.position, light.direction, light.colour,
        light.falls_off, light.cos_inner, light.cos_outer);
  }
  /// Mixes a TriangleMesh or a MeshShape.
  template <class Mesh>
  void add_mesh(const Mesh& mesh) {
    add(mesh.material, mesh.positions, mesh.triangles, mesh.normals, mesh.uvs, mesh.uvs2,
        mesh.colours, mesh.tangents);
  }
  /// Mixes a Sphere or a SphereShape.
  template <class Ball>
  void add_sphere(const Ball& sphere) {
    add(sphere.centre, sphere.radius, sphere.inward, sphere.material);
  }

  [[nodiscard]] Fingerprint value() const { return value_; }

 private:
  Fingerprint value_{0x243F6A8885A308D3U, 0x13198A2E03707344U};
};

/// Returns a fingerprint of everything that determines the appearance of the scene's points:
/// geometry, materials, lights and environment settings. Cameras, names, notes and texture pixels
/// are excluded; callers that need the pixels compare them separately, since every committed scene
/// has a fingerprint.
[[nodiscard]] inline Fingerprint scene_fingerprint(const SceneDescription& scene,
                                                   const Surroundings& surroundings) {
  SceneMixer mixer;
  mixer.add(scene.materials, scene.meshes, scene.shapes, scene.spheres, scene.cones, scene.lights,
            scene.background, scene.ambient, scene.colour_managed, scene.lit_by_studio);
  mixer.add(surroundings.background, surroundings.sky, surroundings.environment_file,
            surroundings.ground, surroundings.ground_shadow, surroundings.ground_colour,
            surroundings.tone_map.has_value(),
            static_cast<int>(surroundings.tone_map.value_or(ToneMap::None)));
  return mixer.value();
}

/// Returns a fingerprint of a scene together with its stage: everything that determines a committed
/// scene, except the pixels of textures and of the environment picture.
[[nodiscard]] inline Fingerprint picture_fingerprint(const Fingerprint& scene, const Stage& stage) {
  SceneMixer mixer;
  mixer.add(scene.first, scene.second);
  mixer.add(stage.world_from_panel, stage.canvas_from_panel);
  const Ground ground = stage.ground.value_or(Ground{});
  mixer.add(stage.near_mm, stage.ground.has_value(), ground.y, ground.size);
  return mixer.value();
}

}  // namespace lenticule::render
