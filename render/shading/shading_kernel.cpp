// SPDX-License-Identifier: Apache-2.0
#include "render/shading/shading_kernel.h"

#include "render/accel/packet_kernel_lanes.h"
#include "render/shading/met_points.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

// ---- sample points, and their maps to a disc and to a hemisphere

inline Words reversed_bits(const Words& v) {
  Words x = v >> 16 | v << 16;
  x = ((x >> 8) & 0x00ff00ffU) | ((x & 0x00ff00ffU) << 8);
  x = ((x >> 4) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4);
  x = ((x >> 2) & 0x33333333U) | ((x & 0x33333333U) << 2);
  return ((x >> 1) & 0x55555555U) | ((x & 0x55555555U) << 1);
}

/// Applies Owen scrambling to a number whose bits are in reverse order, by a hash in which each bit
/// affects only higher bits (Laine and Karras, with Vegdahl's constants). Returns values in [0, 1).
inline Floats scrambled(uint32_t reversed, const Words& seed) {
  Words x = Words::of(reversed);
  x = x ^ x * 0x3d20adeaU;
  x = x + seed;
  x = x * (seed >> 16 | 1U);
  x = x ^ x * 0x05526c56U;
  x = x ^ x * 0x53a22864U;
  // Keeps as many bits as single precision holds.
  return to_floats(masks_of(reversed_bits(x) >> 8)) * (1.0F / (1 << 24));
}

struct Floats2 {
  Floats x, y;
};

/// Returns cosine and sine by their series; up to pi / 4 the first omitted terms are below 1e-9.
inline Floats2 cos_sin(const Floats& angle) {
  const Floats q = angle * angle;
  const Floats cosine =
      1.0F + q * (-1.0F / 2 +
                  q * (1.0F / 24 + q * (-1.0F / 720 + q * (1.0F / 40320 - q * (1.0F / 3628800)))));
  const Floats sine =
      angle *
      (1.0F + q * (-1.0F / 6 + q * (1.0F / 120 + q * (-1.0F / 5040 + q * (1.0F / 362880)))));
  return {cosine, sine};
}

/// Maps a sample to the unit disc: concentric squares become circles (Shirley and Chiu), and areas
/// keep their ratio.
inline Floats2 on_disc(const sampling::Sample& sample) {
  const Floats a = 2.0F * scrambled(sample.x, words_in(sample.set->scramble[0])) - 1.0F;
  const Floats b = 2.0F * scrambled(sample.y, words_in(sample.set->scramble[1])) - 1.0F;
  const Masks wide = absolute(a) > absolute(b);
  const Floats radius = select(wide, a, b);
  const Floats ratio = select(radius != 0.0F, select(wide, b, a) / radius, Floats{});
  constexpr float kQuarterPi = 0.785398163F;
  const Floats2 turn = cos_sin(kQuarterPi * ratio);
  return {radius * select(wide, turn.x, turn.y), radius * select(wide, turn.y, turn.x)};
}

struct Basis {
  Floats3 x, y;
};
/// Returns two unit vectors perpendicular to `z` and to each other (Duff and others). The formula's
/// branch is at an unusual height, so that common surfaces do not lie on the branch.
inline Basis across(const Floats3& z) {
  const Floats sign = select(z.z < -0.31F, Floats::of(-1.0F), Floats::of(1.0F));
  const Floats a = -1.0F / (sign + z.z);
  const Floats b = z.x * z.y * a;
  return {{1.0F + sign * z.x * z.x * a, sign * b, -(sign * z.x)}, {b, sign + z.y * z.y * a, -z.y}};
}

/// Returns a direction around the unit vector `normal`, with a density proportional to its cosine.
inline Floats3 cosine_direction(const Floats3& normal, const sampling::Sample& sample) {
  const Floats2 at = on_disc(sample);
  const Floats height = root(max(1.0F - (at.x * at.x + at.y * at.y), Floats{}));
  const Basis basis = across(normal);
  return basis.x * at.x + basis.y * at.y + normal * height;
}

/// Disc is a disc that faces the lanes.
struct Disc {
  Floats3 way;  ///< vector to the centre
  float radius;
  Basis basis;

  Disc(const Floats3& to_middle, float of_radius)
      : way(to_middle), radius(of_radius), basis(across(unit(to_middle))) {}
  /// Returns the vector to a point of the unit disc.
  Floats3 way_to(const Floats2& at) const {
    return way + (basis.x * at.x + basis.y * at.y) * Floats::of(radius);
  }
};

/// Radon's seven points of the unit disc, which integrate polynomials of degree 5 exactly. All have
/// the same weight except the first.
inline constexpr int kDiscPoints = 7;
inline constexpr float kDiscPoint[kDiscPoints][2] = {{0.0F, 0.0F},
                                                     {0.81649658F, 0.0F},
                                                     {0.40824829F, 0.70710678F},
                                                     {-0.40824829F, 0.70710678F},
                                                     {-0.81649658F, 0.0F},
                                                     {-0.40824829F, -0.70710678F},
                                                     {0.40824829F, -0.70710678F}};
inline constexpr float kDiscWeight[kDiscPoints] = {0.25F,  0.125F, 0.125F, 0.125F,
                                                   0.125F, 0.125F, 0.125F};

// ---- surfaces

bool find_surfaces(const Tables& tables, const float* packet, const int32_t* valid, Surfaces& out) {
  const Words& geometry = words_at(packet + packet_kernel::kGeometry * kLanes);
  const Masks active = masks_at(valid) & (geometry != kNoGeometry);
  masks_at(out.active) = active;
  if (!any(active)) return false;
  out.any_textured = out.any_transmits = out.any_specular = 0;
  Paint paint{};
  const auto set_material = [&](int32_t number, const Masks& where) {
    const Material& m = tables.materials[number];
    set_paint(m, number, where, masks_at(out.channel), paint);
    out.any_textured |= m.textured;
    out.any_transmits |= m.transmittance > 0.0F ? 1 : 0;
    out.any_specular |= m.specular > 0.0F ? 1 : 0;
  };
  Primitives primitives{};
  find_points(tables, packet, active, set_material, primitives, out);
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

inline Floats3 way_to(const Light& light, const Surfaces& s) {
  return way_to(light, vector_at(s.start));
}

inline Arrival arrival(const Light& light, const Floats3& way, const Surfaces& s) {
  Floats colour{};
  set_colours(Masks::of(-1), masks_at(s.channel), light.colour, colour);
  return arrival(light, way, colour);
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

void encode_linear(const frames::LinearCodes& table, const float* light, int32_t count,
                   uint8_t* codes) {
  constexpr float kBelowOne = 0x1.fffffep-1F;
  for (int32_t i = 0; i < count; ++i) {
    const float above = light[i] > 0.0F ? light[i] : 0.0F;
    const float held = above < kBelowOne ? above : kBelowOne;
    const auto bin = static_cast<int32_t>(held * float{frames::LinearCodes::kBins});
    codes[i] = static_cast<uint8_t>(table.first[bin] + (held >= table.limit[bin] ? 1 : 0));
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
                                            .encode = encode,
                                            .encode_linear = encode_linear};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
