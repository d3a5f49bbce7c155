// SPDX-License-Identifier: Apache-2.0
// The primitives and materials that the lanes of a packet met, the points at which they met them,
// and the light that arrives there. For the shading kernels of one instruction set.
#pragma once

#include "render/accel/packet_kernel_lanes.h"
#include "render/rays/primary_packets_kernel.h"
#include "render/scene/surface_cells.h"
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

// ---- points

/// Offset of secondary rays from the surface, as a fraction of (largest coordinate + extent of the
/// primitive, or the reach of a wide one); covers roundings of single precision, see
/// docs/render/methods.md.
constexpr float kSpawnOffset = 1.0F / (1 << 19);

inline Floats largest(const Floats3& v) {
  return max(max(absolute(v.x), absolute(v.y)), absolute(v.z));
}

struct Point {
  Floats3 at, outer, smooth;  // smooth is zero if there is no shading normal
  Floats offset;
  Floats u, v;
  Masks cell_u, cell_v, cell_w, divisions, divisions_along;
};

/// Points where rays met wide shapes.
struct WidePoints {
  Masks lanes;
  Floats3 at, outer;
  Floats u, v, reach;
};

/// Points on one shape, before they are merged with the others. Values in lanes that met another
/// shape are unspecified.
struct alignas(64) WideLanes {
  float at[3][kLanes], outer[3][kLanes];
  float u[kLanes] = {}, v[kLanes] = {};
};

/// Double3 is a point of one lane. Loops over lanes are vectorized for the instruction set.
struct Double3 {
  double x, y, z;
};
inline Double3 operator+(const Double3& a, const Double3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Double3 operator-(const Double3& a, const Double3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Double3 operator*(const Double3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(const Double3& a, const Double3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Double3 point(const double (&v)[3]) { return {v[0], v[1], v[2]}; }
/// Normalizes; the zero vector stays zero.
inline Double3 unit(const Double3& v) {
  const double length = __builtin_sqrt(dot(v, v));
  return v * (length > 0.0 ? 1.0 / length : 0.0);
}
inline void put(const Double3& v, int r, float (&out)[3][kLanes]) {
  out[0][r] = static_cast<float>(v.x);
  out[1][r] = static_cast<float>(v.y);
  out[2][r] = static_cast<float>(v.z);
}

inline Double3 met_point(const float* packet, int r) {
  const auto at = [&](int field) { return double{packet[field * kLanes + r]}; };
  const auto vector = [&](int field) { return Double3{at(field), at(field + 1), at(field + 2)}; };
  return vector(packet_kernel::kOriginX) +
         vector(packet_kernel::kDirectionX) * at(packet_kernel::kTFar);
}

inline double clamped01(double v) { return v > 0.0 ? (v < 1.0 ? v : 1.0) : 0.0; }

/// Projects the points into the triangle's plane and clamps them to the triangle.
inline void on_wide_triangle(const WideTriangle& t, const float* packet, WideLanes& out) {
  for (int r = 0; r < kLanes; ++r) {
    const Double3 from = met_point(packet, r) - point(t.corner);
    const double u = clamped01(dot(from, point(t.u_axis)));
    const double v = clamped01(dot(from, point(t.v_axis)));
    const double sum = u + v;
    const double shrink = sum > 1.0 ? 1.0 / sum : 1.0;
    const double a = u * shrink, b = v * shrink;
    put(point(t.corner) + (point(t.edge1) * a + point(t.edge2) * b), r, out.at);
    put(point(t.normal), r, out.outer);
    out.u[r] = static_cast<float>(a);
    out.v[r] = static_cast<float>(b);
  }
}

inline void on_wide_sphere(const WideQuadric& s, float outward, const float* packet,
                           WideLanes& out) {
  for (int r = 0; r < kLanes; ++r) {
    const Double3 normal = unit(met_point(packet, r) - point(s.centre));
    put(point(s.centre) + normal * s.radius, r, out.at);
    put(normal * double{outward}, r, out.outer);
  }
}

/// Computes points on a cone. The normal is zero at the tip.
inline void on_wide_cone(const WideQuadric& c, float outward, const float* packet, WideLanes& out) {
  for (int r = 0; r < kLanes; ++r) {
    const Double3 axis = point(c.axis), from = met_point(packet, r) - point(c.centre);
    const double along = dot(from, axis);
    const Double3 across = unit(from - axis * along);
    const double low = along > 0.0 ? along : 0.0;
    const double s = low < c.height ? low : c.height;
    put(point(c.centre) + (axis * s + across * (c.radius + c.slope * s)), r, out.at);
    const bool tip = dot(across, across) == 0.0;
    put(unit(across - axis * c.slope) * (tip ? 0.0 : double{outward}), r, out.outer);
  }
}

inline void find_wide_points(const float* packet, const WideShapes& shapes, WidePoints& out) {
  for (int n = 0; n < shapes.count; ++n) {
    const WideShapes::One& one = shapes.shape[n];
    WideLanes lanes;
    if (one.triangle != nullptr)
      on_wide_triangle(*one.triangle, packet, lanes);
    else if (one.is_cone)
      on_wide_cone(*one.quadric, one.outward, packet, lanes);
    else
      on_wide_sphere(*one.quadric, one.outward, packet, lanes);
    const double reach = one.triangle != nullptr ? one.triangle->reach : one.quadric->reach;
    out.lanes = out.lanes | one.lanes;
    out.at = select(one.lanes, vector_at(lanes.at), out.at);
    out.outer = select(one.lanes, vector_at(lanes.outer), out.outer);
    out.u = select(one.lanes, floats_at(lanes.u), out.u);
    out.v = select(one.lanes, floats_at(lanes.v), out.v);
    set(one.lanes, static_cast<float>(reach), out.reach);
  }
}

/// Returns the number of cells along a length, at least one.
inline Masks cells_along(const Floats& length, float most) {
  const Floats cells = length * (1.0F / kCellSize);
  return to_integers(max(min(cells + 0.999F, Floats::of(most)), Floats::of(1.0F)));
}
/// Returns the number of direction cells along each side of the octahedron's square for a shape of
/// the given radius; always even.
inline Masks cells_around(const Floats& radius, float most) {
  constexpr float kAround = 1.75F;  // half the side of a square with the area of a unit sphere
  const Floats cells = radius * (kAround / kCellSize);
  return 2 * to_integers(max(min(cells + 0.999F, Floats::of(0.5F * most)), Floats::of(1.0F)));
}

/// Computes points on triangles. `met` is projected into the triangle's plane and clamped to the
/// triangle, since Embree may have chosen the neighbour at an edge. Lengths are scaled by the
/// triangle's extent, so that none is too small or too large to be squared.
inline void on_triangles(const Primitives& p, const Floats3& met, const WidePoints* wide,
                         Point& out) {
  const Floats extent = max(largest(p.edge1), largest(p.edge2));
  const Floats scale = select(p.triangles, 1.0F / extent, Floats{});
  const Floats3 e1 = p.edge1 * scale, e2 = p.edge2 * scale;
  const Floats3 from_a = (met - p.a) * scale;
  const Floats3 normal = cross(e1, e2);
  const Floats squared = dot(normal, normal);
  const Floats inverse = select(squared > 0.0F, 1.0F / squared, Floats{});
  Floats u = clamp01(dot(cross(from_a, e2), normal) * inverse);
  Floats v = clamp01(dot(cross(e1, from_a), normal) * inverse);
  const Floats sum = u + v;
  const Floats shrink = select(sum > 1.0F, 1.0F / sum, Floats::of(1.0F));
  u = u * shrink;
  v = v * shrink;
  if (wide != nullptr) {
    u = select(wide->lanes, wide->u, u);
    v = select(wide->lanes, wide->v, v);
  }
  out.at = p.a + (p.edge1 * u + p.edge2 * v);
  out.outer = unit(normal);
  const Floats3 smooth = p.normal_a * ((1.0F - u) - v) + (p.normal_b * u + p.normal_c * v);
  out.smooth = select(p.smooth, unit(smooth), Floats3{});
  out.offset = kSpawnOffset * (largest(out.at) + extent);
  out.u = u;
  out.v = v;
  out.divisions = cells_along(extent, kMostCells);
  const Floats count = to_floats(out.divisions);
  out.cell_u = clamp_index(to_integers(u * count), out.divisions);
  out.cell_v = clamp_index(to_integers(v * count), out.divisions);
}

inline void set(const Masks& where, const Masks& u, const Masks& v, const Masks& count,
                Point& out) {
  out.cell_u = select(where, u, out.cell_u);
  out.cell_v = select(where, v, out.cell_v);
  out.divisions = select(where, count, out.divisions);
}

inline void on_spheres(const Primitives& p, const Floats3& met, Point& out) {
  const Floats3 outward = unit(met - p.centre);
  const Floats3 at = p.centre + outward * p.radius;
  out.at = select(p.spheres, at, out.at);
  out.outer = select(p.spheres, outward * p.outward, out.outer);
  out.smooth = select(p.spheres, Floats3{}, out.smooth);
  out.offset = select(p.spheres, kSpawnOffset * (largest(at) + p.radius), out.offset);
  const Masks count = cells_around(p.radius, kMostCells);
  Masks u, v;
  octahedron_cell(outward, count, u, v);
  set(p.spheres, u, v, count, out);
}

inline void on_cones(const Primitives& p, const Floats3& met, Point& out) {
  const Floats3 from_base = met - p.centre;
  const Floats along = dot(from_base, p.axis);
  const Floats3 across = unit(from_base - p.axis * along);
  const Floats s = min(max(along, Floats{}), p.height);
  const Floats radius = p.radius + p.slope * s;
  const Floats3 at = p.centre + p.axis * s + across * radius;
  const Floats3 outward = unit(across - p.axis * p.slope);
  const Masks tip = dot(across, across) == 0.0F;
  out.at = select(p.cones, at, out.at);
  out.outer = select(p.cones, select(tip, Floats3{}, outward * p.outward), out.outer);
  out.smooth = select(p.cones, Floats3{}, out.smooth);
  out.offset =
      select(p.cones, kSpawnOffset * (largest(at) + max(absolute(radius), p.height)), out.offset);
  const Masks count = cells_around(max(p.radius, p.radius + p.slope * p.height), 8.0F);
  Masks u, v;
  octahedron_cell(across, count, u, v);
  set(p.cones, u, v, count, out);
  const Masks along_count = cells_along(p.height, kMostCellsAlong);
  const Floats part = s * (to_floats(along_count) / max(p.height, Floats::of(1e-30F)));
  out.divisions_along = select(p.cones, along_count, out.divisions_along);
  out.cell_w = select(p.cones, clamp_index(to_integers(part), along_count), out.cell_w);
}

/// Replaces the single-precision results in lanes that met wide shapes.
inline void put_wide(const WidePoints& wide, Point& out) {
  out.at = select(wide.lanes, wide.at, out.at);
  out.outer = select(wide.lanes, wide.outer, out.outer);
  out.offset = select(wide.lanes, kSpawnOffset * (largest(wide.at) + wide.reach), out.offset);
}

inline void write_point(const Floats3& view, const Point& point, Surfaces& out) {
  // The tip of a cone has no normal; the direction back to the viewer is used instead.
  const Masks lost = dot(point.outer, point.outer) == 0.0F;
  const Floats3 outer = select(lost, -view, point.outer);
  const Masks outside = dot(view, outer) <= 0.0F;
  const Floats3 geometric = select(outside, outer, -outer);
  const Masks flat = dot(point.smooth, point.smooth) == 0.0F;
  Floats3 smooth = select(flat, geometric, point.smooth);
  smooth = select(dot(smooth, geometric) < 0.0F, -smooth, smooth);
  store(view, out.view);
  store(point.at, out.point);
  store(point.at + geometric * point.offset, out.start);
  store(geometric, out.geometric);
  store(smooth, out.smooth);
  floats_at(out.spawn_offset) = point.offset;
  masks_at(out.outer_side) = outside;
  floats_at(out.u) = point.u;
  floats_at(out.v) = point.v;
  masks_at(out.cell_u) = point.cell_u;
  masks_at(out.cell_v) = point.cell_v;
  masks_at(out.cell_w) = point.cell_w;
  masks_at(out.divisions) = point.divisions;
  masks_at(out.divisions_along) = point.divisions_along;
}

/// Finds the points of the `active` lanes of a packet, and the primitives that they lie on.
/// `set_material` as for gather().
template <class SetMaterial>
inline void find_points(const Tables& tables, const float* packet, const Masks& active,
                        const SetMaterial& set_material, Primitives& primitives, Surfaces& out) {
  WideShapes shapes;
  gather(tables, packet, active, set_material, primitives, shapes);
  WidePoints wide;
  const bool has_wide = shapes.count > 0;
  if (has_wide) {
    wide = {};
    find_wide_points(packet, shapes, wide);
  }

  const Floats3 direction{field(packet, packet_kernel::kDirectionX),
                          field(packet, packet_kernel::kDirectionY),
                          field(packet, packet_kernel::kDirectionZ)};
  const Floats3 origin{field(packet, packet_kernel::kOriginX),
                       field(packet, packet_kernel::kOriginY),
                       field(packet, packet_kernel::kOriginZ)};
  const Floats3 met = origin + direction * field(packet, packet_kernel::kTFar);
  Point point{};
  if (any(primitives.triangles)) on_triangles(primitives, met, has_wide ? &wide : nullptr, point);
  if (any(primitives.spheres)) on_spheres(primitives, met, point);
  if (any(primitives.cones)) on_cones(primitives, met, point);
  if (has_wide) put_wide(wide, point);
  write_point(unit(direction), point, out);
}

// ---- light

/// Fraction of the distance to a light within which an occluder counts as the light itself.
constexpr float kLightClearance = 1.0F / (1 << 18);
/// Limit of embree_accepts().
constexpr float kEmbreeLimit = 1e16F;

/// Direction and distance of a light, and the light that arrives if unoccluded.
struct Arrival {
  Floats3 toward;
  Floats distance, intensity;
};

/// Returns the vector from `start` to a light's centre; unit if the light is directional.
inline Floats3 way_to(const Light& light, const Floats3& start) {
  if (light.kind == Light::kDirectional) return Floats3{} - spread(light.direction);
  return spread(light.position) - start;
}

/// `intensity` is that of the light itself.
inline Arrival arrival(const Light& light, const Floats3& way, const Floats& intensity) {
  Arrival at{};
  at.intensity = intensity;
  if (light.kind == Light::kDirectional) {
    at.toward = way;
    at.distance = Floats::of(__builtin_inff());
    return at;
  }
  const Floats squared = dot(way, way);
  at.distance = root(squared);
  const Masks apart = at.distance > 0.0F;
  at.toward = way * select(apart, 1.0F / at.distance, Floats{});
  at.intensity = select(apart, at.intensity, Floats{});
  if (light.kind == Light::kSpot) {
    const Floats inside = Floats{} - dot(spread(light.direction), at.toward) - light.cos_outer;
    const Floats part = light.cos_width > 0.0F ? clamp01(inside / light.cos_width)
                                               : select(inside >= 0.0F, Floats::of(1.0F), Floats{});
    at.intensity = at.intensity * (part * part);
  }
  if (light.falls_off)
    at.intensity = select(apart, at.intensity * (light.world_units_squared / squared), Floats{});
  return at;
}

/// Returns false for NaN.
inline Masks within_limits(const Floats3& v) {
  return (absolute(v.x) < kEmbreeLimit) & (absolute(v.y) < kEmbreeLimit) &
         (absolute(v.z) < kEmbreeLimit);
}

/// Writes the rays of lanes that are `wanted` and valid for Embree, and harmless rays in the other
/// lanes.
inline bool write_rays(const Floats3& origin, const Floats3& direction, const Floats& far,
                       const Masks& wanted, NewRays& out) {
  const Masks fit = within_limits(origin) & within_limits(direction) & (far >= 0.0F) &
                    (dot(direction, direction) > 0.0F);
  const Masks valid = wanted & fit;
  out.refused = 0;
  const Masks refused = wanted & ~fit;
  if (any(refused))
    for (int r = 0; r < kLanes; ++r) out.refused -= refused[r];
  masks_at(out.valid) = valid;
  float* packet = out.packet;
  floats_at(packet + packet_kernel::kOriginX * kLanes) = select(valid, origin.x, Floats{});
  floats_at(packet + packet_kernel::kOriginY * kLanes) = select(valid, origin.y, Floats{});
  floats_at(packet + packet_kernel::kOriginZ * kLanes) = select(valid, origin.z, Floats{});
  floats_at(packet + packet_kernel::kDirectionX * kLanes) = select(valid, direction.x, Floats{});
  floats_at(packet + packet_kernel::kDirectionY * kLanes) = select(valid, direction.y, Floats{});
  floats_at(packet + packet_kernel::kDirectionZ * kLanes) =
      select(valid, direction.z, Floats::of(1.0F));
  floats_at(packet + packet_kernel::kTFar * kLanes) = select(valid, far, Floats{});
  return any(valid);
}

}  // namespace

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
