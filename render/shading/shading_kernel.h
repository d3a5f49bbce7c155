// SPDX-License-Identifier: Apache-2.0
// Shading of sixteen rays at a time, compiled once per instruction set; docs/render/shading.md
// states the formulas. Plain data only: this header must not bring shared inline functions into a
// file that is compiled for AVX-512.
//
// Computes in single precision, in the scene frame, without fused multiplication: the same hits
// give the same bits on every instruction set. render/shading/shading.h computes
// the same ray by ray in double precision; it is the reference in tests.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "frames/linear_codes.h"

namespace lenticule::render {

/// The unit of fine code values: 1 / kCodeParts of an 8-bit code value.
inline constexpr int kCodeParts = 128;

}  // namespace lenticule::render

namespace lenticule::render::sampling {

/// SampleSet holds the scrambling seeds of the points of sixteen lanes, per dimension;
/// render/shading/soft_shader.h makes them.
struct alignas(64) SampleSet {
  uint32_t scramble[2][16];
};

/// Sample is one point of each lane's set.
struct Sample {
  const SampleSet* set;
  uint32_t x, y;  ///< before scrambling, with the bits in reverse order
};

}  // namespace lenticule::render::sampling

namespace lenticule::render::shading_kernel {

inline constexpr int kLanes = 16;

struct Material {
  float colour[3];
  float emission[3];
  float diffuse;
  float specular;
  float shine;
  float transmittance;
  int32_t tinted;    ///< highlights and reflections have the material's colour
  int32_t textured;  ///< the caller multiplies colours
};

/// WideTriangle is shaded in double precision, see render/accel/primitives.h.
struct WideTriangle {
  double corner[3];
  double edge1[3], edge2[3];
  double normal[3];
  double u_axis[3], v_axis[3];
  double reach;
};
inline constexpr uint32_t kNotWide = ~0U;

struct Mesh {
  const float* positions;     ///< x, y, z of each vertex
  const uint32_t* triangles;  ///< three vertices each
  const float* normals;       ///< unit, x, y, z of each vertex, or null
  int32_t material;
  const uint32_t* wide;  ///< per triangle: in `wide_triangles` or kNotWide; null if none is wide
  const WideTriangle* wide_triangles;
};

/// WideQuadric holds a wide sphere or cone in double precision.
struct WideQuadric {
  double centre[3];
  double radius;
  double axis[3];
  double height;
  double slope;
  double reach;
};

/// Quadric is a sphere or an open cone; see render/accel/primitives.h.
struct Quadric {
  float centre[3];  ///< centre of the sphere or of the cone's base
  float radius;     ///< radius of the sphere or of the cone's base
  float axis[3];    ///< unit; cones only
  float height;
  float slope;
  float outward;  ///< 1, or -1 if the inside is the outer side
  int32_t material;
  const WideQuadric* wide;  ///< null unless the shape is wide
};

struct Geometry {
  enum Kind : int32_t { kMesh, kSpheres, kCones } kind;
  Mesh mesh;
  const Quadric* quadrics;  ///< indexed by primitive
};

struct Light {
  enum Kind : int32_t { kPoint, kDirectional, kSpot } kind;
  float position[3];
  float direction[3];
  float colour[3];
  float cos_outer;
  float cos_width;  ///< cosine of the inner cone minus cos_outer
  int32_t falls_off;
  float world_units_squared;  ///< scene units per world unit, squared
};

struct Tables {
  const Geometry* geometries;  ///< indexed by Embree's geometry number
  const Material* materials;
  float ambient[3];
};

/// Surfaces holds the shading data of the surfaces that a packet's lanes met. Inactive lanes are
/// unspecified.
struct alignas(64) Surfaces {
  int32_t active[kLanes];   ///< -1 in lanes that met a surface
  int32_t channel[kLanes];  ///< 0, 1 or 2: set by the caller
  float view[3][kLanes];    ///< unit, direction of the incoming ray
  float point[3][kLanes];
  float start[3][kLanes];      ///< start of secondary rays on the viewer's side
  float geometric[3][kLanes];  ///< unit normal on the side from which the ray came
  float smooth[3][kLanes];     ///< the shading normal, on the same side
  float spawn_offset[kLanes];
  int32_t outer_side[kLanes];  ///< -1 if the ray came from outside
  float colour[kLanes];        ///< the material's, in the ray's channel
  float diffuse[kLanes];
  float specular[kLanes];  ///< untinted
  float shine[kLanes];
  float emission[kLanes];
  int32_t tinted[kLanes];
  int32_t material[kLanes];
  float u[kLanes], v[kLanes];  ///< barycentric; meshes only
  // Cell of the surface, see render/scene/surface_cells.h.
  int32_t cell_u[kLanes], cell_v[kLanes], cell_w[kLanes];
  int32_t divisions[kLanes], divisions_along[kLanes];
  int32_t any_textured;
  int32_t any_transmits;
  int32_t any_specular;
};

/// NewRays holds secondary rays in Embree's layout (see packet_kernel::Field) and their weights.
struct alignas(64) NewRays {
  float weight[kLanes];  ///< factor of the arriving light
  int32_t bin_u[kLanes],
      bin_v[kLanes];  ///< direction bin; mirrored rays only
  float* packet;      ///< receives origin, direction and t_far
  int32_t* valid;     ///< -1 in lanes with a ray
  int32_t refused;    ///< number of rays that were not valid for Embree
};

using sampling::Sample;

/// CellGroups lists the different cells of a packet's lanes.
struct CellGroups {
  int32_t count;
  int32_t first[kLanes];   ///< first lane of each cell
  uint32_t lanes[kLanes];  ///< bit mask of each cell's lanes
  int32_t place[kLanes];   ///< place of the cell on its primitive, see render/scene/surface_cells.h
};

/// Bit masks of the lanes on which the whole area light would shine, and of those on which a part
/// of it would.
struct AreaLightLanes {
  uint32_t whole;
  uint32_t partly;
};

struct Kernel {
  /// Computes the surfaces of a packet that Embree has intersected; `valid` marks the lanes that
  /// were traced. Returns false, and writes only `active`, if no lane met a surface.
  bool (*find_surfaces)(const Tables&, const float* packet, const int32_t* valid, Surfaces&);
  void (*group_cells)(const float* packet, const Surfaces&, CellGroups&);
  /// Adds emission and ambient light to `light`. `weight`: weights of the rays that met the
  /// surfaces.
  void (*add_own_light)(const Tables&, const Surfaces&, const float* weight, float* light);
  /// Like add_own_light, with an ambient light per lane.
  void (*add_own_light_under)(const float* ambient, const Surfaces&, const float* weight,
                              float* light);
  /// Makes rays toward a light from the lanes it can shine on; the rays' `weight` is the light that
  /// they add if unoccluded. Returns false if there are none.
  bool (*shadow_rays)(const Light&, const Surfaces&, const float* weight, NewRays&);
  /// Makes rays toward a point of a disc around the light that faces the surface. `radius` is in
  /// scene units; for a directional light it is the tangent of the angular radius.
  bool (*area_light_rays)(const Light&, float radius, const Sample&, const Surfaces&,
                          const float* weight, NewRays&);
  /// Integrates the light of the whole unoccluded disc by quadrature; 0 in lanes without a surface.
  /// `radius` as for area_light_rays.
  AreaLightLanes (*whole_area_light)(const Light&, float radius, const Surfaces&,
                                     const float* weight, float* brings);
  /// Makes ambient rays of length `far` from diffuse surfaces into the hemisphere, with a density
  /// proportional to the cosine to the shading normal. Their weight is 1. Returns false if there
  /// are none.
  bool (*ambient_rays)(float far, const Sample&, const Surfaces&, NewRays&);
  /// Makes mirrored rays. Returns false if there are none.
  bool (*mirrored_rays)(const Surfaces&, const float* weight, NewRays&);
  /// Adds `brings` to the light of the given lanes.
  void (*add_light)(uint32_t lanes, const float* brings, float* light);
  /// Disables rays that contribute at most `most`, if half of the contribution is within the lane's
  /// remaining allowed error `tolerance_left`, and adds this half instead. Returns a bit mask of
  /// these lanes.
  uint32_t (*leave_out)(float most, const float* brings, int32_t* valid, float* tolerance_left,
                        float* light);
  /// Converts `count` values of encoded light to code values, as frames::code_from_encoded() does.
  void (*encode)(const float* light, int32_t count, uint8_t* codes);
  /// Converts linear light, as frames::code_from_linear() does.
  void (*encode_linear)(const frames::LinearCodes& table, const float* light, int32_t count,
                        uint8_t* codes);
};

}  // namespace lenticule::render::shading_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(shading_kernel::Kernel, kShadingKernel)
}
