// SPDX-License-Identifier: Apache-2.0
// Reference implementation of metallic-roughness shading: the formulas of docs/render/shading.md as
// they stand there, in double precision, with integrals in place of tables. It shares no code with
// render/ beyond the description of a point.
#pragma once

#include <functional>

#include "render/shading/pbr_scene.h"

namespace lenticule::test {

/// Returns the integral of the GGX lobe's reflectance times the cosine, for a Fresnel reflectance
/// of f0 at normal and f90 at grazing incidence. Isotropic.
[[nodiscard]] double oracle_ggx_albedo(double view_cosine, double roughness, double f0, double f90);

/// Returns the integral of white sheen's reflectance times the cosine.
[[nodiscard]] double oracle_sheen_albedo(double view_cosine, double roughness);

/// Returns pi times the reflectance function times the cosine.
[[nodiscard]] Vec3 oracle_of_light(const render::PbrPoint& point, Vec3 toward_light);

/// Returns the integral of `value` over the hemisphere around `axis`.
[[nodiscard]] Vec3 hemisphere_integral(Vec3 axis, int steps,
                                       const std::function<Vec3(Vec3)>& value);

/// Returns Khronos' PBR Neutral tone map.
[[nodiscard]] Vec3 oracle_pbr_neutral(Vec3 light);

}  // namespace lenticule::test
