// SPDX-License-Identifier: Apache-2.0
// Metallic-roughness shading of sixteen points at a time, compiled once per instruction set, for
// materials that are a base and a mirror, with or without sheen and a coat. docs/render/shading.md
// states the formulas. Plain data only: this header must not bring shared inline functions into a
// file that is compiled for AVX-512.
//
// Computes in single precision without fused multiplication, as render/shading/shading_kernel.h
// does. render/shading/pbr_scene.h computes the same point by point in double precision; it is
// the reference in tests.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/shading/shading_kernel.h"
#include "render/textures/texel_kernel.h"

namespace lenticule::render::pbr_kernel {

/// Limits holds constants of the model in the precision of either implementation.
template <class Real>
struct Limits {
  static constexpr Real kGrazing = Real(0.02);  ///< cosine below which footprints are not exact
  static constexpr Real kSmallestCosine = Real(1e-3);       ///< normal maps may turn a normal away
  static constexpr Real kSmallestRoughness = Real(0.0525);  ///< lights have no size to be mirrored
  static constexpr Real kSmallestSheenRoughness = Real(0.07);  ///< below, fibres lie in the surface
  static constexpr Real kMostBend = Real(0.18);  ///< largest square of alpha that the shape adds
  static constexpr Real kCoatF0 = Real(0.04);    ///< reflectance of a coat, head on
};

using shading_kernel::kLanes;
using shading_kernel::Surfaces;
using texel_kernel::Values;

/// Material holds the factors of a material.
struct Material {
  float colour[3];
  float emission[3];
  float metallic;
  float roughness;
  float f0[3];  ///< reflectance of the dielectric, head on
  float f90;    ///< reflectance of the dielectric, grazing
  float coat, coat_roughness;
  // Factors that textures multiply:
  enum AlphaMode : int32_t { kOpaque, kMask, kBlend } alpha_mode;
  float alpha, alpha_cutoff;
  float normal_scale, occlusion_strength;
  float plain_f0;  ///< reflectance of the dielectric, head on, without `specular` factors
  float specular, specular_colour[3];
  float sheen_colour[3], sheen_roughness;
  int32_t is_plain;      ///< -1 if this kernel can shade the material
  int32_t is_two_sided;  ///< -1 if the inner side is shaded, too
  int32_t is_textured;   ///< textures or colours of vertices change the factors
};

/// Beam is render::BeamSize, with the panel's axes in the scene frame.
struct Beam {
  float across[3], along[3];  ///< one millimetre along the panel's x and y axes
  float depth[3];             ///< panel z of a point: dot product with this ...
  float depth_origin;         ///< ... plus this
  float lens_mm, row_mm, subpixels_per_gap, inverse_distance;
};

/// Map holds the light of all directions in the square of an unfolded octahedron with a border, as
/// render::EnvironmentLight does: three numbers per texel, and a fourth one after the last texel.
struct Map {
  const float* texels;
  int32_t size;
};

/// Environment is the light that surrounds the scene.
struct Environment {
  static constexpr int kMaps = 8;
  float right[3], up[3], back[3];  ///< its axes
  int32_t is_uniform;
  float uniform[3];
  Map diffuse;
  Map mirrored[kMaps];  ///< maps for the roughnesses 1 / kMaps, 2 / kMaps ... 1
};

/// AlbedoTable holds scale and bias of render::GgxAlbedo. The knots are uniform in the root of the
/// cosine and in the roughness: values[cosine][roughness].
struct AlbedoTable {
  static constexpr int kSteps = 64;
  float values[kSteps + 1][kSteps + 1][2];
};

/// SheenTable holds render::sheen_albedo() at the same knots.
struct SheenTable {
  float values[AlbedoTable::kSteps + 1][AlbedoTable::kSteps + 1];
};

/// AxesInput is what the axes of a normal map depend on: tangents of the vertices or, if these are
/// null, the change of the texture coordinates along the triangle's edges.
struct alignas(64) AxesInput {
  float edge1[2][kLanes], edge2[2][kLanes];
  const Values* vertex;
};

/// Textures holds what textures and vertices say at the points of lanes that have one material.
/// A null pointer changes nothing.
struct Textures {
  uint32_t lanes;  ///< bit mask
  const Values *base_colour, *vertex_colour, *metallic_roughness, *occlusion, *normal, *emission,
      *specular, *specular_colour, *sheen_colour, *sheen_roughness, *coat, *coat_roughness,
      *coat_normal;
  AxesInput normal_axes, coat_axes;
};

struct Tables {
  const shading_kernel::Tables* shapes;
  const Material* materials;
  Environment environment;
  const AlbedoTable* albedo;
  const SheenTable* sheen;  ///< null if no material has sheen
};

/// Points holds what the materials say at the points that a packet's lanes met. Values in lanes
/// that are not active are unspecified.
struct alignas(64) Points {
  int32_t active[kLanes];  ///< -1 in lanes that this kernel shades
  float alpha[kLanes];     ///< share of the light that does not pass; 0 on invisible sides
  // Changes of the barycentric coordinates across the sides of the footprint. Meshes only.
  float across[2][kLanes], along[2][kLanes];
  float edge1[3][kLanes], edge2[3][kLanes];  ///< triangle edges divided by its extent
  float bend[kLanes];       ///< square of the angle by which the normal changes across it
  float normal[3][kLanes];  ///< unit, from the normal map, on the viewer's side
  float spread[kLanes];     ///< square of alpha by which the normal map varies
  float colour[3][kLanes];
  float emission[3][kLanes];
  float metallic[kLanes];
  float roughness[kLanes];
  float occlusion[kLanes];
  float f0[3][kLanes];
  float f90[kLanes];
  float sheen_colour[3][kLanes], sheen_roughness[kLanes];
  float coat[kLanes], coat_roughness[kLanes];
  float coat_normal[3][kLanes], coat_spread[kLanes];
  int32_t any_sheen, any_coat;
  uint32_t textured;  ///< bit mask of visible lanes with textures, which the caller applies
};

/// Shaded holds the parts of the formula that do not depend on lights.
struct alignas(64) Shaded {
  float view_cosine[kLanes];
  float roughness[kLanes];  ///< widened by what varies within the footprint
  float mirror[3][kLanes];  ///< direction in the environment's axes, not unit
  float source[3][kLanes];  ///< the light of the source there, which the caller sets
  float f0[3][kLanes], f90[kLanes];
  float stronger[3][kLanes];
  float diffuse[3][kLanes];
  float below_sheen[kLanes];  ///< share of the light that goes through the sheen
  float light[3][kLanes];     ///< reflected light of the environment, and emission
  uint32_t sharp;             ///< bit mask of lanes that see the environment's source in mirrors
  // The same of the coat; only set if there is one.
  alignas(64) float coat_cosine[kLanes];
  float coat_roughness[kLanes];
  float coat_mirror[3][kLanes], coat_source[3][kLanes];
  float below_coat[kLanes];  ///< share of the light that goes through the coat
  uint32_t coat_sharp;
};

/// LightRays holds rays toward a light.
struct alignas(64) LightRays {
  float brings[3][kLanes];  ///< light that the ray adds if unoccluded
  float* packet;            ///< receives rays in Embree's layout
  int32_t* valid;           ///< -1 in lanes with a ray
  int32_t refused;          ///< number of rays that were not valid for Embree
};

enum class ToneMap : int32_t { kNone, kPbrNeutral, kAces };

struct Kernel {
  /// Finds the points of the lanes of a packet that are `valid` and met a surface whose material
  /// this kernel can shade. Returns a bit mask of these lanes.
  uint32_t (*find)(const Tables&, const Beam&, const float* packet, const int32_t* valid, Surfaces&,
                   Points&);
  /// Changes the points by textures.
  void (*apply)(const Material&, const Textures&, const Surfaces&, Points&);
  /// Computes the directions of mirrored light. Then the caller sets source and coat_source.
  void (*aim)(const Tables&, const Surfaces&, const Points&, Shaded&);
  /// Computes all other members of Shaded.
  void (*shade)(const Tables&, const Points&, Shaded&);
  /// Makes rays toward a light from the lanes it can shine on, harmless rays in all other lanes.
  void (*light_rays)(const shading_kernel::Light&, const Surfaces&, const Points&, const Shaded&,
                     LightRays&);
  /// Computes render::tone_mapped() of all lanes.
  void (*tone_map)(ToneMap, const float (&light)[3][kLanes], float (&shown)[3][kLanes]);
};

}  // namespace lenticule::render::pbr_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(pbr_kernel::Kernel, kPbrKernel)
}
