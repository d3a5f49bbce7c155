// SPDX-License-Identifier: Apache-2.0
// Metallic-roughness shading of a point, in three channels. docs/render/shading.md states the
// formulas.
#pragma once

#include "render/shading/environment_light.h"
#include "render/shading/pbr_brdf.h"

namespace lenticule::render {

/// PbrPoint is a point of a surface and what its material's factors and textures say there.
/// Directions are unit and in the scene frame; normals are on the viewer's side.
struct PbrPoint {
  Vec3 view{};       ///< toward the viewer
  Vec3 geometric{};  ///< normal of the primitive
  Vec3 normal{};     ///< of the normal map
  Vec3 tangent{};    ///< direction of anisotropy; perpendicular to `normal`
  Vec3 coat_normal{};
  Vec3 colour{1, 1, 1};  ///< base colour
  double alpha = 1.0;    ///< share of the light that the surface does not let pass unchanged
  double metallic = 0.0;
  double roughness = 1.0;
  double occlusion = 1.0;  ///< share of the environment that the point sees
  Vec3 emission{};
  double ior = 1.5;
  double specular = 1.0;
  Vec3 specular_colour{1, 1, 1};
  double clearcoat = 0.0;
  double clearcoat_roughness = 0.0;
  Vec3 sheen_colour{};
  double sheen_roughness = 0.0;
  double transmission = 0.0;
  double iridescence = 0.0;
  double iridescence_ior = 1.3;
  double iridescence_nm = 400.0;
  double anisotropy = 0.0;
};

/// PbrShader evaluates one point for lights and the environment.
class PbrShader {
 public:
  explicit PbrShader(const PbrPoint& point);

  /// Returns the share of a light that the surface reflects toward the viewer: pi times the
  /// reflectance function times the cosine. Zero if the light is behind the surface.
  [[nodiscard]] Vec3 of_light(Vec3 toward_light) const;
  /// Returns the light of the environment that the surface reflects toward the viewer. Directions
  /// of the environment are map_from_scene times those of the scene frame.
  struct Frame {
    Vec3 right{1, 0, 0}, up{0, 1, 0}, back{0, 0, 1};
    [[nodiscard]] Vec3 from_scene(Vec3 d) const {
      return {dot(right, d), dot(up, d), dot(back, d)};
    }
  };
  [[nodiscard]] Vec3 of_environment(const EnvironmentLight& light, const Frame& frame) const;
  /// Returns the light that the surface emits.
  [[nodiscard]] Vec3 emitted() const;
  /// Returns the share of the light behind the surface that is transmitted.
  [[nodiscard]] Vec3 transmitted() const;

 private:
  PbrPoint point_;
  Vec3 bitangent_{};
  double view_cosine_ = 1.0;
  LocalVec local_view_{};
  double coat_cosine_ = 1.0;
  double alpha_t_ = 1.0, alpha_b_ = 1.0;
  Vec3 f0_{}, f90_{};
  Vec3 single_{};              ///< albedo of light that is reflected once
  Vec3 multiple_{};            ///< albedo of light that is reflected between microfacets
  Vec3 stronger_{};            ///< (single + multiple) / single
  double below_mirror_ = 1.0;  ///< share of the light that goes through the GGX lobe of dielectrics
  Vec3 diffuse_{};
  double sheen_albedo_ = 0.0;
  double below_sheen_ = 1.0;
  double coat_albedo_ = 0.0;
  double below_coat_ = 1.0;
};

/// Smallest roughness that lights see: they have no size, so mirrors would not show them.
inline constexpr double kSmallestRoughness = 0.0525;

}  // namespace lenticule::render
