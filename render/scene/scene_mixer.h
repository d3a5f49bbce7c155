// SPDX-License-Identifier: Apache-2.0
// SceneMixer computes fingerprints of scene parts, as described or as committed.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render/scene/fingerprint.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

class SceneMixer : public WordMixer {
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
    add(m.colour);
    add(m.diffuse);
    add(m.specular);
    add(m.shine);
    add(m.transmittance);
    add(m.refraction_index);
    add(m.emission);
    add(m.tinted_specular);
    add(m.texture);
    add(m.pbr != nullptr);
    if (m.pbr) add(*m.pbr);
  }
  void add(const TextureUse& use) {
    add(use.texture);
    add(use.uv_set);
    add(use.uv_map);
  }
  void add(const PbrMaterial& m) {
    add(static_cast<int>(m.alpha_mode));
    for (const bool flag : {m.double_sided, m.unlit}) add(flag);
    for (const double number : {m.alpha,
                                m.metallic,
                                m.roughness,
                                m.normal_scale,
                                m.occlusion_strength,
                                m.alpha_cutoff,
                                m.ior,
                                m.specular,
                                m.clearcoat,
                                m.clearcoat_roughness,
                                m.sheen_roughness,
                                m.transmission,
                                m.thickness,
                                m.attenuation_distance,
                                m.iridescence,
                                m.iridescence_ior,
                                m.iridescence_thickness_min,
                                m.iridescence_thickness_max,
                                m.anisotropy,
                                m.anisotropy_rotation})
      add(number);
    for (const Vec3& colour :
         {m.base_colour, m.emission, m.specular_colour, m.sheen_colour, m.attenuation_colour})
      add(colour);
    for (const TextureUse& use :
         {m.base_colour_texture, m.metallic_roughness_texture, m.normal_texture,
          m.occlusion_texture, m.emission_texture, m.specular_texture, m.specular_colour_texture,
          m.clearcoat_texture, m.clearcoat_roughness_texture, m.clearcoat_normal_texture,
          m.sheen_colour_texture, m.sheen_roughness_texture, m.transmission_texture,
          m.thickness_texture, m.iridescence_texture, m.iridescence_thickness_texture,
          m.anisotropy_texture})
      add(use);
  }
  void add(const TriangleMesh& mesh) { add_mesh(mesh); }
  void add(const Sphere& sphere) { add_sphere(sphere); }
  void add(const Cone& cone) {
    add(cone.base);
    add(cone.base_radius);
    add(cone.apex);
    add(cone.apex_radius);
    add(cone.inward);
    add(cone.material);
  }
  void add(const Light& light) { add_light(light); }

  /// Mixes a Light or a SceneLight.
  template <class L>
  void add_light(const L& light) {
    add(static_cast<int>(light.kind));
    add(light.position);
    add(light.direction);
    add(light.colour);
    add(light.falls_off);
    add(light.cos_inner);
    add(light.cos_outer);
  }
  /// Mixes a TriangleMesh or a MeshShape.
  template <class Mesh>
  void add_mesh(const Mesh& mesh) {
    add(mesh.material);
    add(mesh.positions);
    add(mesh.triangles);
    add(mesh.normals);
    add(mesh.uvs);
    add(mesh.uvs2);
    add(mesh.colours);
    add(mesh.tangents);
  }
  /// Mixes a Sphere or a SphereShape.
  template <class Ball>
  void add_sphere(const Ball& sphere) {
    add(sphere.centre);
    add(sphere.radius);
    add(sphere.inward);
    add(sphere.material);
  }
};

}  // namespace lenticule::render
