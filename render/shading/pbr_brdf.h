// SPDX-License-Identifier: Apache-2.0
// Reflectance functions of the metallic-roughness model; docs/render/shading.md states the
// formulas. `alpha` is the square of the roughness. Cosines are those to the shading normal.
#pragma once

#include "optics/vec.h"
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

}  // namespace lenticule::render
