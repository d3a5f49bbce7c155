// SPDX-License-Identifier: Apache-2.0
// Shading of sixteen rays at a time, compiled once per instruction set; docs/rendering.md states
// the formulas. Plain data only: nothing here may bring a shared inline function into a file that
// is compiled for AVX-512.
//
// Single precision, in the scene frame, without fused multiplication: the same hits give the same
// bits on every instruction set. render/shading/surface.h and render/shading/shading.h say the same
// ray by ray in double precision, and are what this is tested against.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/shading/sample_data.h"

namespace lenticule::render::shading_kernel {

inline constexpr int kLanes = 16;

struct Material {
  float colour[3];
  float emission[3];
  float diffuse;
  float specular;
  float shine;
  float transmittance;
  int32_t tinted;    ///< highlights and mirror have the material's colour
  int32_t textured;  ///< the caller multiplies colours
};

/// Met in double precision, see render/accel/wide_triangle.h.
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
  const uint32_t* wide;  ///< by triangle, in `wide_triangles` or kNotWide; null if none is wide
  const WideTriangle* wide_triangles;
};

/// Where a wide sphere or cone is.
struct WideQuadric {
  double centre[3];
  double radius;
  double axis[3];
  double height;
  double slope;
  double reach;
};

/// A sphere or an open cone; see render/accel/quadrics.h.
struct Quadric {
  float centre[3];  ///< of the sphere, or of the cone's base
  float radius;     ///< there
  float axis[3];    ///< unit; cones only
  float height;
  float slope;
  float outward;  ///< 1, or -1 where the inside is the outer side
  int32_t material;
  const WideQuadric* wide;  ///< null if it is not
};

struct Geometry {
  enum Kind : int32_t { kMesh, kSpheres, kCones } kind;
  Mesh mesh;
  const Quadric* quadrics;  ///< by primitive
};

struct Light {
  enum Kind : int32_t { kPoint, kDirectional, kSpot } kind;
  float position[3];
  float direction[3];
  float colour[3];
  float cos_outer;
  float cos_width;  ///< between the outer and the inner cone
  int32_t falls_off;
  float world_units_squared;  ///< scene units per world unit, squared
};

struct Tables {
  const Geometry* geometries;  ///< by Embree's geometry number
  const Material* materials;
  float ambient[3];
};

/// Surfaces that the lanes of a packet met, as shading sees them. Only active lanes mean anything.
struct alignas(64) Surfaces {
  int32_t active[kLanes];   ///< -1 where something was met
  int32_t channel[kLanes];  ///< 0, 1 or 2: set by the caller
  float view[3][kLanes];    ///< unit, the way the ray came
  float point[3][kLanes];
  float start[3][kLanes];      ///< of new rays on the viewer's side
  float geometric[3][kLanes];  ///< unit normal on the side that the ray came from
  float smooth[3][kLanes];     ///< the shading normal, on the same side
  float spawn_offset[kLanes];
  int32_t outer_side[kLanes];  ///< -1 where the ray came from outside
  float colour[kLanes];        ///< of the material, in the ray's channel
  float diffuse[kLanes];
  float specular[kLanes];  ///< not yet tinted
  float shine[kLanes];
  float emission[kLanes];
  int32_t tinted[kLanes];
  int32_t material[kLanes];
  float u[kLanes], v[kLanes];  ///< barycentric, of meshes
  // The cell of the surface, see render/scene/surface_cells.h.
  int32_t cell_u[kLanes], cell_v[kLanes], cell_w[kLanes];
  int32_t divisions[kLanes], divisions_along[kLanes];
  int32_t any_textured;
  int32_t any_transmits;
  int32_t any_specular;
};

/// New rays in Embree's layout (see packet_kernel::Field) and what they bring.
struct alignas(64) NewRays {
  float weight[kLanes];  ///< what arrives is multiplied by that
  int32_t bin_u[kLanes],
      bin_v[kLanes];  ///< of the direction, in kDirectionBins; mirrored rays only
  float* packet;      ///< origin, direction and t_far are written here
  int32_t* valid;     ///< -1 where there is a ray
  int32_t refused;    ///< how many were not fit for Embree
};

using sampling::Sample;

/// The different cells that a packet's lanes lie in.
struct CellGroups {
  int32_t count;
  int32_t first[kLanes];   ///< a lane of each
  uint32_t lanes[kLanes];  ///< a bit for each of its lanes
  int32_t place[kLanes];   ///< where it lies on its primitive, see render/scene/surface_cells.h
};

/// Lanes, a bit each, on which all of a lamp would shine, and those on which some of it would.
struct LampLanes {
  uint32_t whole;
  uint32_t partly;
};

struct Kernel {
  /// From a packet that Embree has intersected and the lanes that were valid. False, and nothing
  /// written but `active`, if no lane met anything.
  bool (*find_surfaces)(const Tables&, const float* packet, const int32_t* valid, Surfaces&);
  void (*group_cells)(const float* packet, const Surfaces&, CellGroups&);
  /// weight: of the rays that met the surfaces. Adds emission and ambient light to `light`.
  void (*add_own_light)(const Tables&, const Surfaces&, const float* weight, float* light);
  /// The same with an ambient light of each lane's own.
  void (*add_own_light_under)(const float* ambient, const Surfaces&, const float* weight,
                              float* light);
  /// Rays toward a light from where it would be seen; `weight` is what it adds there. False if
  /// there are none.
  bool (*shadow_rays)(const Light&, const Surfaces&, const float* weight, NewRays&);
  /// The same toward a point of a disc around the light that faces the surface. `radius` is in
  /// scene units, of a directional light the tangent of the angle at which it is seen.
  bool (*lamp_rays)(const Light&, float radius, const Sample&, const Surfaces&, const float* weight,
                    NewRays&);
  /// What the whole disc brings if nothing is in the way, by quadrature; 0 where no surface is.
  /// `radius` as above.
  LampLanes (*whole_lamp)(const Light&, float radius, const Surfaces&, const float* weight,
                          float* brings);
  /// Rays of length `far` from diffuse surfaces to all that lies before them, as dense as the
  /// cosine to the shading normal says. Their weight is 1. False if there are none.
  bool (*ambient_rays)(float far, const Sample&, const Surfaces&, NewRays&);
  /// Mirrored rays. False if there are none.
  bool (*mirrored_rays)(const Surfaces&, const float* weight, NewRays&);
  /// Adds what some lanes' rays bring to their light.
  void (*add_light)(uint32_t lanes, const float* brings, float* light);
  /// Makes rays invalid that bring at most `most`, as long as half of it is within what a lane's
  /// light may still be off by; adds that half instead. Returns those lanes.
  uint32_t (*leave_out)(float most, const float* brings, int32_t* valid, float* leeway,
                        float* light);
};

}  // namespace lenticule::render::shading_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(shading_kernel::Kernel, kShadingKernel)
}
