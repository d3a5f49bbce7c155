// SPDX-License-Identifier: Apache-2.0
// The primitives and materials that the lanes of a packet met, for the shading kernel of one
// instruction set.
#pragma once

#include "render/rays/primary_packets_kernel.h"
#include "render/shading/packet_kernel_lanes.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace shading_kernel;
using packet_kernel::Field;

/// Embree's geometry number of rays that met nothing.
constexpr uint32_t kNoGeometry = ~0U;

inline const Floats& field(const float* packet, Field which) {
  return floats_at(packet + which * kLanes);
}
inline Floats3 vector_at(const float (&lanes)[3][kLanes]) {
  return {floats_at(lanes[0]), floats_at(lanes[1]), floats_at(lanes[2])};
}
inline void store(const Floats3& v, float (&lanes)[3][kLanes]) {
  floats_at(lanes[0]) = v.x;
  floats_at(lanes[1]) = v.y;
  floats_at(lanes[2]) = v.z;
}

/// Primitives holds the data of the primitive that each lane met.
struct Primitives {
  Floats3 a, edge1, edge2;  // triangles
  Floats3 normal_a, normal_b, normal_c;
  Masks smooth;
  Floats3 centre, axis;  // spheres and cones
  Floats radius, height, slope, outward;
  Masks spheres, cones, triangles;
};

inline void set(const Masks& where, float value, Floats& lanes) {
  lanes = select(where, Floats::of(value), lanes);
}
inline void set(const Masks& where, const float* value, Floats3& lanes) {
  set(where, value[0], lanes.x);
  set(where, value[1], lanes.y);
  set(where, value[2], lanes.z);
}
inline void set_difference(const Masks& where, const float* to, const float* from, Floats3& lanes) {
  set(where, to[0] - from[0], lanes.x);
  set(where, to[1] - from[1], lanes.y);
  set(where, to[2] - from[2], lanes.z);
}

inline void set_triangle(const Mesh& mesh, uint32_t primitive, const Masks& where, Primitives& p) {
  const uint32_t* corner = mesh.triangles + size_t{3} * primitive;
  const size_t a = size_t{3} * corner[0], b = size_t{3} * corner[1], c = size_t{3} * corner[2];
  p.triangles = p.triangles | where;
  set(where, mesh.positions + a, p.a);
  set_difference(where, mesh.positions + b, mesh.positions + a, p.edge1);
  set_difference(where, mesh.positions + c, mesh.positions + a, p.edge2);
  if (!mesh.normals) return;
  p.smooth = p.smooth | where;
  set(where, mesh.normals + a, p.normal_a);
  set(where, mesh.normals + b, p.normal_b);
  set(where, mesh.normals + c, p.normal_c);
}

inline void set_quadric(const Quadric& shape, bool cone, const Masks& where, Primitives& p) {
  set(where, shape.centre, p.centre);
  set(where, shape.radius, p.radius);
  set(where, shape.outward, p.outward);
  if (!cone) {
    p.spheres = p.spheres | where;
    return;
  }
  p.cones = p.cones | where;
  set(where, shape.axis, p.axis);
  set(where, shape.height, p.height);
  set(where, shape.slope, p.slope);
}

/// Paint holds the material of each lane, in the lane's channel.
struct Paint {
  Floats colour, emission, diffuse, specular, shine;
  Masks tinted, number;
};

inline void set_colours(const Masks& where, const Masks& channel, const float* rgb, Floats& lanes) {
  for (int c = 0; c < 3; ++c) set(where & (channel == c), rgb[c], lanes);
}

inline void set_paint(const Material& m, int32_t number, const Masks& where, const Masks& channel,
                      Paint& paint) {
  set_colours(where, channel, m.colour, paint.colour);
  set_colours(where, channel, m.emission, paint.emission);
  set(where, m.diffuse, paint.diffuse);
  set(where, m.specular, paint.specular);
  set(where, m.shine, paint.shine);
  if (m.tinted) paint.tinted = paint.tinted | where;
  paint.number = select(where, Masks::of(number), paint.number);
}

/// WideShapes lists the wide shapes that a packet met, and the lanes that met each.
struct WideShapes {
  struct One {
    Masks lanes;
    const WideTriangle* triangle;  ///< or null
    const WideQuadric* quadric;
    bool is_cone;
    float outward;
  };
  int count = 0;
  One shape[kLanes];

  void add(const One& one) { shape[count++] = one; }
};

inline void add_if_wide(const Geometry& geometry, uint32_t primitive, const Masks& where,
                        WideShapes& wide) {
  const Mesh& mesh = geometry.mesh;
  if (geometry.kind != Geometry::kMesh) {
    const Quadric& q = geometry.quadrics[primitive];
    if (q.wide != nullptr)
      wide.add({where, nullptr, q.wide, geometry.kind == Geometry::kCones, q.outward});
  } else if (mesh.wide != nullptr && mesh.wide[primitive] != kNotWide) {
    wide.add({where, mesh.wide_triangles + mesh.wide[primitive], nullptr, false, 1.0F});
  }
}

/// Collects the data of the different primitives of a packet; neighbouring rays meet few.
/// set_material(number, where) is called with the material of each.
template <class SetMaterial>
inline void gather(const Tables& tables, const float* packet, const Masks& active,
                   const SetMaterial& set_material, Primitives& p, WideShapes& wide) {
  const Words& geometry = words_at(packet + packet_kernel::kGeometry * kLanes);
  const Words& primitive = words_at(packet + packet_kernel::kPrimitive * kLanes);
  Masks left = active;
  for (int lane = 0; lane < kLanes; ++lane) {
    if (left[lane] == 0) continue;
    const uint32_t g = geometry[lane];
    const uint32_t number = primitive[lane];
    const Masks where = left & (geometry == g) & (primitive == number);
    left = left & ~where;
    const Geometry& shape = tables.geometries[g];
    int32_t material = shape.mesh.material;
    if (shape.kind == Geometry::kMesh) {
      set_triangle(shape.mesh, number, where, p);
    } else {
      set_quadric(shape.quadrics[number], shape.kind == Geometry::kCones, where, p);
      material = shape.quadrics[number].material;
    }
    add_if_wide(shape, number, where, wide);
    set_material(material, where);
  }
}

inline void write_paint(const Paint& paint, Surfaces& out) {
  floats_at(out.colour) = paint.colour;
  floats_at(out.emission) = paint.emission;
  floats_at(out.diffuse) = paint.diffuse;
  floats_at(out.specular) = paint.specular;
  floats_at(out.shine) = paint.shine;
  masks_at(out.tinted) = paint.tinted;
  masks_at(out.material) = paint.number;
}

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
