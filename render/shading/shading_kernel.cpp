// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading_kernel.h"

#include "render/shading/met_points.h"
#include "render/shading/sampling_lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

/// Fraction of the distance to a light within which an occluder counts as the light itself.
constexpr float kLightClearance = 1.0F / (1 << 18);
/// Embree aborts the process on some numbers beyond this limit.
constexpr float kEmbreeLimit = 1e18F;
constexpr uint32_t kNoGeometry = ~0U;

bool find_surfaces(const Tables& tables, const float* packet, const int32_t* valid, Surfaces& out) {
  const Words& geometry = words_at(packet + packet_kernel::kGeometry * kLanes);
  const Masks active = masks_at(valid) & (geometry != kNoGeometry);
  masks_at(out.active) = active;
  if (!any(active)) return false;
  out.any_textured = out.any_transmits = out.any_specular = 0;
  Primitives primitives{};
  Paint paint{};
  WideShapes shapes;
  gather(tables, packet, active, primitives, shapes, paint, out);
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
  write_paint(paint, out);
  return true;
}

void group_cells(const float* packet, const Surfaces& s, CellGroups& groups) {
  const Words& geometry = words_at(packet + packet_kernel::kGeometry * kLanes);
  const Words& primitive = words_at(packet + packet_kernel::kPrimitive * kLanes);
  const Masks place = (masks_at(s.cell_u) << kPlaceU) | (masks_at(s.cell_v) << kPlaceV) |
                      (masks_at(s.cell_w) << kPlaceW) | (masks_at(s.outer_side) & 1);
  groups.count = 0;
  uint32_t left = bits(masks_at(s.active));
  while (left != 0) {
    const int lane = __builtin_ctz(left);
    const Masks same =
        (geometry == geometry[lane]) & (primitive == primitive[lane]) & (place == place[lane]);
    const uint32_t lanes = bits(same) & left;
    groups.first[groups.count] = lane;
    groups.lanes[groups.count] = lanes;
    groups.place[groups.count] = place[lane];
    ++groups.count;
    left &= ~lanes;
  }
}

inline void add_own(const Floats& ambient, const Surfaces& s, const float* weight, float* light) {
  const Floats own = floats_at(s.emission) + ambient * floats_at(s.diffuse) * floats_at(s.colour);
  floats_at(light) =
      floats_at(light) + select(masks_at(s.active), floats_at(weight) * own, Floats{});
}

void add_own_light(const Tables& tables, const Surfaces& s, const float* weight, float* light) {
  Floats ambient{};
  set_colours(Masks::of(-1), masks_at(s.channel), tables.ambient, ambient);
  add_own(ambient, s, weight, light);
}

void add_own_light_under(const float* ambient, const Surfaces& s, const float* weight,
                         float* light) {
  add_own(floats_at(ambient), s, weight, light);
}

/// Direction and distance of a light, and the light that arrives if unoccluded.
struct Arrival {
  Floats3 toward;
  Floats distance, intensity;
};

/// Returns the vector to a light's centre; unit if the light is directional.
inline Floats3 way_to(const Light& light, const Surfaces& s) {
  if (light.kind == Light::kDirectional) return Floats3{} - spread(light.direction);
  return spread(light.position) - vector_at(s.start);
}

inline Arrival arrival(const Light& light, const Floats3& way, const Surfaces& s) {
  Arrival at{};
  set_colours(Masks::of(-1), masks_at(s.channel), light.colour, at.intensity);
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

/// Returns the light that arrives from a point of the area light's disc, given in unit-disc
/// coordinates.
inline Arrival arrival_from(const Light& light, const Disc& disc, const Floats2& at,
                            const Surfaces& s) {
  const Floats3 way = disc.way_to(at);
  return arrival(light, light.kind == Light::kDirectional ? unit(way) : way, s);
}

/// Returns Lambert's diffuse term plus Phong's highlight; zero if the light is behind the surface.
inline Floats reflected(const Surfaces& s, const Arrival& light) {
  const Floats3 smooth = vector_at(s.smooth);
  const Floats cosine = dot(smooth, light.toward);
  const Masks seen =
      (cosine > 0.0F) & (dot(vector_at(s.geometric), light.toward) > 0.0F) & masks_at(s.active);
  if (!any(seen)) return Floats{};
  Floats reflectance = floats_at(s.diffuse) * floats_at(s.colour) * cosine;
  const Floats3 view = vector_at(s.view);
  // Cosine between the light's mirror direction and the viewer.
  const Floats along = dot(light.toward, view) - 2.0F * cosine * dot(smooth, view);
  const Masks shines = seen & (along > 0.0F) & (floats_at(s.specular) > 0.0F);
  if (any(shines)) {
    const Floats tint = select(masks_at(s.tinted), floats_at(s.colour), Floats::of(1.0F));
    const Floats highlight = floats_at(s.specular) * tint * power(along, floats_at(s.shine));
    reflectance = select(shines, reflectance + highlight, reflectance);
  }
  return select(seen, light.intensity * reflectance, Floats{});
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

inline bool rays_toward(const Arrival& at, const Surfaces& s, const float* weight, NewRays& out) {
  const Floats brings = floats_at(weight) * reflected(s, at);
  floats_at(out.weight) = brings;
  const Masks wanted = masks_at(s.active) & (brings != 0.0F);
  if (!any(wanted)) {
    masks_at(out.valid) = Masks{};
    out.refused = 0;
    return false;
  }
  return write_rays(vector_at(s.start), at.toward, at.distance * (1.0F - kLightClearance), wanted,
                    out);
}

bool shadow_rays(const Light& light, const Surfaces& s, const float* weight, NewRays& out) {
  return rays_toward(arrival(light, way_to(light, s), s), s, weight, out);
}

bool area_light_rays(const Light& light, float radius, const Sample& sample, const Surfaces& s,
                     const float* weight, NewRays& out) {
  return rays_toward(arrival_from(light, Disc(way_to(light, s), radius), on_disc(sample), s), s,
                     weight, out);
}

AreaLightLanes whole_area_light(const Light& light, float radius, const Surfaces& s,
                                const float* weight, float* brings) {
  const Disc disc(way_to(light, s), radius);
  Floats sum{};
  Masks all = Masks::of(-1), some{};
  for (int n = 0; n < kDiscPoints; ++n) {
    const Floats2 at{Floats::of(kDiscPoint[n][0]), Floats::of(kDiscPoint[n][1])};
    const Floats from_there = floats_at(weight) * reflected(s, arrival_from(light, disc, at, s));
    const Masks shines = masks_at(s.active) & (from_there != 0.0F);
    all = all & shines;
    some = some | shines;
    sum = sum + kDiscWeight[n] * from_there;
  }
  floats_at(brings) = sum;
  return {.whole = bits(all), .partly = bits(some & ~all)};
}

bool ambient_rays(float far, const Sample& sample, const Surfaces& s, NewRays& out) {
  const Floats3 geometric = vector_at(s.geometric);
  const Floats3 by_smooth = cosine_direction(vector_at(s.smooth), sample);
  // Directions around an interpolated normal may lie below the geometric surface; those are
  // mirrored to above it.
  const Floats below = min(dot(by_smooth, geometric), Floats{});
  const Masks diffuse = masks_at(s.active) & (floats_at(s.diffuse) * floats_at(s.colour) != 0.0F);
  floats_at(out.weight) = Floats::of(1.0F);
  return write_rays(vector_at(s.start), by_smooth - geometric * (2.0F * below), Floats::of(far),
                    diffuse, out);
}

inline Floats3 mirrored(const Floats3& view, const Floats3& normal) {
  return view - normal * (2.0F * dot(view, normal));
}

bool mirrored_rays(const Surfaces& s, const float* weight, NewRays& out) {
  const Floats tint = select(masks_at(s.tinted), floats_at(s.colour), Floats::of(1.0F));
  const Floats part = floats_at(weight) * (floats_at(s.specular) * tint);
  const Masks wanted = masks_at(s.active) & (part != 0.0F);
  floats_at(out.weight) = part;
  const Floats3 view = vector_at(s.view), geometric = vector_at(s.geometric);
  const Floats3 by_smooth = mirrored(view, vector_at(s.smooth));
  // An interpolated normal can mirror a ray into its own surface; the geometric normal cannot.
  const Floats3 direction =
      select(dot(by_smooth, geometric) > 0.0F, by_smooth, mirrored(view, geometric));
  const Floats3 away = unit(direction);
  Masks u, v;
  octahedron_cell(away, Masks::of(kDirectionBins), u, v);
  masks_at(out.bin_u) = u;
  masks_at(out.bin_v) = v;
  return write_rays(vector_at(s.start), away, Floats::of(__builtin_inff()), wanted, out);
}

void add_light(uint32_t lanes, const float* brings, float* light) {
  floats_at(light) = floats_at(light) + select(lanes_of(lanes), floats_at(brings), Floats{});
}

uint32_t leave_out(float most, const float* brings, int32_t* valid, float* tolerance_left,
                   float* light) {
  const Floats half = 0.5F * floats_at(brings);
  const Floats off = absolute(half);
  const Masks little =
      masks_at(valid) & (off <= floats_at(tolerance_left)) & (2.0F * off <= Floats::of(most));
  const uint32_t lanes = bits(little);
  if (lanes == 0) return 0;
  masks_at(valid) = masks_at(valid) & ~little;
  floats_at(tolerance_left) = floats_at(tolerance_left) - select(little, off, Floats{});
  floats_at(light) = floats_at(light) + select(little, half, Floats{});
  return lanes;
}

void encode(const float* light, int32_t count, uint8_t* codes) {
  for (int32_t i = 0; i < count; ++i) {
    const float above = light[i] > 0.0F ? light[i] : 0.0F;
    const float held = above < 1.0F ? above : 1.0F;
    codes[i] = static_cast<uint8_t>(static_cast<int32_t>(double{held} * 255.0 + 0.5));
  }
}

}  // namespace

extern const shading_kernel::Kernel kShadingKernel;
const shading_kernel::Kernel kShadingKernel{.find_surfaces = find_surfaces,
                                            .group_cells = group_cells,
                                            .add_own_light = add_own_light,
                                            .add_own_light_under = add_own_light_under,
                                            .shadow_rays = shadow_rays,
                                            .area_light_rays = area_light_rays,
                                            .whole_area_light = whole_area_light,
                                            .ambient_rays = ambient_rays,
                                            .mirrored_rays = mirrored_rays,
                                            .add_light = add_light,
                                            .leave_out = leave_out,
                                            .encode = encode};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
