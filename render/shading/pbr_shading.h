// SPDX-License-Identifier: Apache-2.0
// Metallic-roughness shading of a point, in three channels, and the reflectance functions of the
// model; docs/render/shading.md states the formulas. `alpha` is the square of the roughness.
// Cosines are those to the shading normal.
#pragma once

#include "optics/vec.h"
#include "render/shading/environment_light.h"
#include "render/shading/pbr_kernel.h"

namespace lenticule::render {

/// Directions in the frame of a surface: x along its tangent, y along its bitangent, z along its
/// normal.
using LocalVec = Vec3;

/// Returns the density of GGX microfacets with the normal `half`. The roughness along the tangent
/// differs from that along the bitangent if the surface is anisotropic.
[[nodiscard]] double ggx_distribution(LocalVec half, double alpha_t, double alpha_b);
/// Returns Smith's height-correlated shadowing and masking, divided by 4 (n . v) (n . l).
[[nodiscard]] double smith_visibility(LocalVec view, LocalVec light, double alpha_t,
                                      double alpha_b);
/// Returns the reflectance of a dielectric at normal incidence, with glTF's `specular` factors.
[[nodiscard]] Vec3 dielectric_f0(double ior, double specular, Vec3 specular_colour);
/// Returns Schlick's approximation of the Fresnel reflectance.
[[nodiscard]] Vec3 schlick(Vec3 f0, Vec3 f90, double cosine);

/// The directional albedo of the GGX lobe: all light that a surface reflects toward a viewer under
/// uniform light is f0 * scale + f90 * bias.
struct GgxAlbedo {
  double scale = 1.0;
  double bias = 0.0;
};
/// Looks up the albedo in a table, within 0.004 of the integral.
[[nodiscard]] GgxAlbedo ggx_albedo(double view_cosine, double roughness);
/// Returns the same table in single precision.
[[nodiscard]] const pbr_kernel::AlbedoTable& ggx_albedo_table();

/// Returns the density of Charlie's microfacets, which model cloth.
[[nodiscard]] double charlie_distribution(double half_cosine, double alpha);
/// Returns Neubelt's visibility for cloth.
[[nodiscard]] double neubelt_visibility(double view_cosine, double light_cosine);
/// Looks up the directional albedo of white sheen in a table, within 0.01 of the integral, but at
/// most 1: at grazing angles the model itself reflects more light than arrives.
[[nodiscard]] double sheen_albedo(double view_cosine, double roughness);
/// Smallest roughness of sheen: below it, all fibres would lie in the surface.
inline constexpr double kSmallestSheenRoughness = 0.07;

/// Returns the reflectance, at normal incidence, of a base with reflectance `base_f0` under a thin
/// film (Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
/// Iridescence", 2017, as glTF states it).
[[nodiscard]] Vec3 film_f0(double film_ior, double view_cosine, double thickness_nm, Vec3 base_f0);

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
