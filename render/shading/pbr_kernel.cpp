// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_kernel.h"

#include "render/accel/packet_kernel_lanes.h"
#include "render/shading/met_points.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

// ---- look-ups in the tables

/// Four numbers of one lane.
using Four = float __attribute__((vector_size(16)));

inline Four four_at(const float* at) { return reinterpret_cast<const Unaligned<Four>*>(at)->v; }

struct Albedo {
  Floats scale, bias;
};

/// Interpolates scale and bias of the GGX lobe.
inline Albedo albedo_at(const pbr_kernel::AlbedoTable& table, const Floats& cosine,
                        const Floats& roughness) {
  constexpr int kSteps = pbr_kernel::AlbedoTable::kSteps;
  constexpr int kRow = 2 * (kSteps + 1);
  const Floats c = root(clamp01(cosine)) * float{kSteps}, r = clamp01(roughness) * float{kSteps};
  const Masks row = clamp_index(to_integers(c), Masks::of(kSteps));
  const Masks column = clamp_index(to_integers(r), Masks::of(kSteps));
  const Floats part = c - to_floats(row), across = r - to_floats(column);
  const Masks at = row * kRow + column * 2;
  const float* const values = &table.values[0][0][0];
  alignas(64) float knots[4][kLanes];
  for (int n = 0; n < kLanes; ++n) {
    const float* knot = values + at[n];
    const Four above = four_at(knot), below = four_at(knot + kRow);
    const Four mean = above + (below - above) * part[n];
    for (int k = 0; k < 4; ++k) knots[k][n] = mean[k];
  }
  const Floats scale = floats_at(knots[0]), bias = floats_at(knots[1]);
  return {scale + (floats_at(knots[2]) - scale) * across,
          bias + (floats_at(knots[3]) - bias) * across};
}

/// Interpolates the albedo of white sheen.
inline Floats sheen_at(const pbr_kernel::SheenTable& table, const Floats& cosine,
                       const Floats& roughness) {
  constexpr int kSteps = pbr_kernel::AlbedoTable::kSteps;
  constexpr int kRow = kSteps + 1;
  const Floats c = root(clamp01(cosine)) * float{kSteps}, r = clamp01(roughness) * float{kSteps};
  const Masks row = clamp_index(to_integers(c), Masks::of(kSteps));
  const Masks column = clamp_index(to_integers(r), Masks::of(kSteps));
  const Masks at = row * kRow + column;
  alignas(64) float knots[4][kLanes];
  for (int n = 0; n < kLanes; ++n) {
    const float* knot = &table.values[0][0] + at[n];
    knots[0][n] = knot[0];
    knots[1][n] = knot[1];
    knots[2][n] = knot[kRow];
    knots[3][n] = knot[kRow + 1];
  }
  const Floats across = r - to_floats(column);
  const Floats above = floats_at(knots[0]) + (floats_at(knots[1]) - floats_at(knots[0])) * across;
  const Floats below = floats_at(knots[2]) + (floats_at(knots[3]) - floats_at(knots[2])) * across;
  return above + (below - above) * (c - to_floats(row));
}

/// Place is where a direction lies in the square of the unfolded octahedron; between 0 and 1.
struct Place {
  Floats x, y;
};

inline Place place_of(const Floats3& d) {
  const Floats sum = absolute(d.x) + absolute(d.y) + absolute(d.z);
  const Floats scale = select(sum > 0.0F, 1.0F / sum, Floats{});
  const Floats x = d.x * scale, z = d.z * scale;
  const Masks lower = d.y < 0.0F;
  const Floats folded_x = 1.0F - absolute(z), folded_z = 1.0F - absolute(x);
  const Floats at_x = select(lower, select(x < 0.0F, -folded_x, folded_x), x);
  const Floats at_z = select(lower, select(z < 0.0F, -folded_z, folded_z), z);
  return {0.5F + 0.5F * at_x, 0.5F + 0.5F * at_z};
}

/// Texels are the four that surround a place in a map of `size`.
struct Texels {
  Masks first;  ///< number of the first one, from the beginning of the map
  Floats x, y;  ///< parts of the following ones

  Texels(const Place& place, const Masks& size) {
    // Measured from the border's texel, so that truncation rounds down.
    const Floats count = to_floats(size);
    const Floats column = place.x * count + 0.5F, row = place.y * count + 0.5F;
    const Masks i = clamp_index(to_integers(column), size + 1);
    const Masks k = clamp_index(to_integers(row), size + 1);
    first = k * (size + 2) + i;
    x = column - to_floats(i);
    y = row - to_floats(k);
  }
};

/// Interpolates in one lane; the last number is without meaning.
inline Four mean_of(const pbr_kernel::Map& map, const Texels& texels, int lane) {
  const float* upper = map.texels + 3 * texels.first[lane];
  const float* lower = upper + 3 * (map.size + 2);
  const Four a = four_at(upper), b = four_at(upper + 3);
  const Four c = four_at(lower), d = four_at(lower + 3);
  const Four above = a + (b - a) * texels.x[lane], below = c + (d - c) * texels.x[lane];
  return above + (below - above) * texels.y[lane];
}

inline void set(const Four& rgb, int lane, float (&out)[3][kLanes]) {
  for (int k = 0; k < 3; ++k) out[k][lane] = rgb[k];
}

inline Floats3 light_of(const pbr_kernel::Map& map, const Place& place) {
  const Texels texels(place, Masks::of(map.size));
  alignas(64) float light[3][kLanes];
  for (int r = 0; r < kLanes; ++r) set(mean_of(map, texels, r), r, light);
  return vector_at(light);
}

/// Number of the map of the next larger roughness; 0 in lanes that see the source as well.
struct MapPlace {
  Masks above;
  Floats part;  ///< weight of that map

  explicit MapPlace(const Floats& roughness) {
    constexpr int kMaps = pbr_kernel::Environment::kMaps;
    const Floats at = clamp01(roughness) * float{kMaps};
    above = clamp_index(to_integers(at), Masks::of(kMaps));
    part = at - to_floats(above);
  }
};

/// Returns mirrored light. `source` is the light of the source in lanes that see it.
inline Floats3 mirrored_light(const pbr_kernel::Map* maps, const Floats3& direction,
                              const Floats& roughness, const float (&source)[3][kLanes]) {
  const Place place = place_of(direction);
  const MapPlace at(roughness);
  const Masks below = select(at.above > 0, at.above - 1, Masks{});
  alignas(64) int32_t above_size[kLanes], below_size[kLanes];
  for (int r = 0; r < kLanes; ++r) {
    above_size[r] = maps[at.above[r]].size;
    below_size[r] = maps[below[r]].size;
  }
  const Texels sharper(place, masks_at(below_size)), blurrier(place, masks_at(above_size));
  alignas(64) float light[3][kLanes];
  for (int r = 0; r < kLanes; ++r) {
    const Four first = at.above[r] > 0 ? mean_of(maps[below[r]], sharper, r)
                                       : Four{source[0][r], source[1][r], source[2][r], 0.0F};
    const Four second = mean_of(maps[at.above[r]], blurrier, r);
    set(first + (second - first) * at.part[r], r, light);
  }
  return vector_at(light);
}

// ---- tone maps of render/scene/surroundings.h

inline Floats largest_of(const Floats3& v) { return max(max(v.x, v.y), v.z); }
inline Floats smallest_of(const Floats3& v) { return min(min(v.x, v.y), v.z); }
inline Floats3 all(const Floats& v) { return {v, v, v}; }

inline Floats3 pbr_neutral(const Floats3& light) {
  constexpr float kFloor = 0.04F;
  constexpr float kStart = 0.8F - kFloor;
  constexpr float kDesaturation = 0.15F;
  constexpr float kRoom = 1.0F - kStart;
  const Floats low = smallest_of(light);
  const Floats floor =
      select(low < 2.0F * kFloor, low - low * low * (0.25F / kFloor), Floats::of(kFloor));
  const Floats3 lowered = light - all(floor);
  const Floats peak = largest_of(lowered);
  const Masks bright = ~(peak < kStart);
  if (!any(bright)) return lowered;
  const Floats shown = 1.0F - kRoom * kRoom / (peak + (kRoom - kStart));
  const Floats kept = 1.0F / (kDesaturation * (peak - shown) + 1.0F);
  const Floats3 compressed = lowered * (shown / peak * kept) + all(shown * (1.0F - kept));
  return select(bright, compressed, lowered);
}

/// Returns the product with a matrix, of which these are the columns.
inline Floats3 product(const float (&columns)[3][3], const Floats3& v) {
  return spread(columns[0]) * v.x + spread(columns[1]) * v.y + spread(columns[2]) * v.z;
}

inline Floats aces_curve(const Floats& v) {
  return (v * (v + 0.0245786F) - 0.000090537F) / (v * (0.983729F * v + 0.4329510F) + 0.238081F);
}

inline Floats3 aces(const Floats3& light) {
  constexpr float kIn[3][3] = {{0.59719F, 0.07600F, 0.02840F},
                               {0.35458F, 0.90834F, 0.13383F},
                               {0.04823F, 0.01566F, 0.83777F}};
  constexpr float kOut[3][3] = {{1.60475F, -0.10208F, -0.00327F},
                                {-0.53108F, 1.10813F, -0.07276F},
                                {-0.07367F, -0.00605F, 1.07602F}};
  constexpr float kExposure = 1.0F / 0.6F;
  const Floats3 in = product(kIn, light * Floats::of(kExposure));
  const Floats3 out = product(kOut, {aces_curve(in.x), aces_curve(in.y), aces_curve(in.z)});
  return {clamp01(out.x), clamp01(out.y), clamp01(out.z)};
}

// ---- materials

using pbr_kernel::Beam;
using pbr_kernel::Environment;
using pbr_kernel::LightRays;
using pbr_kernel::Points;
using pbr_kernel::Shaded;

using Limits = pbr_kernel::Limits<float>;
constexpr float kInversePi = 0.318309886F;

inline Floats3 operator*(const Floats3& a, const Floats3& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
inline Floats3 mixed(const Floats3& a, const Floats3& b, const Floats& part) {
  return a + (b - a) * part;
}
inline Floats quotient(const Floats& a, const Floats& b) {
  return select(b > 0.0F, a / b, Floats::of(1.0F));
}
inline Floats3 quotient(const Floats3& a, const Floats3& b) {
  return {quotient(a.x, b.x), quotient(a.y, b.y), quotient(a.z, b.z)};
}
inline Floats fifth_power(const Floats& v) {
  const Floats squared = v * v;
  return squared * squared * v;
}
inline Masks nonzero(const Floats3& v) { return (v.x != 0.0F) | (v.y != 0.0F) | (v.z != 0.0F); }

// ---- points

inline void set(const Masks& where, const float (&rgb)[3], float (&lanes)[3][kLanes]) {
  for (int c = 0; c < 3; ++c) set(where, rgb[c], floats_at(lanes[c]));
}

/// Sets the factors of the lanes' materials. Lanes whose material this kernel cannot shade become
/// inactive.
inline void set_factors(const pbr_kernel::Material* materials, const Masks& numbers,
                        const Surfaces& s, Points& p) {
  Masks plain{}, textured{};
  p.any_coat = p.any_sheen = 0;
  uint32_t left = bits(masks_at(s.active));
  while (left != 0) {
    const int32_t number = numbers[__builtin_ctz(left)];
    const Masks where = lanes_of(left) & (numbers == number);
    left &= ~bits(where);
    const pbr_kernel::Material& m = materials[number];
    if (m.is_plain == 0) continue;
    plain = plain | where;
    const Masks seen = where & (masks_at(s.outer_side) | m.is_two_sided);
    floats_at(p.alpha) =
        select(where, select(seen, Floats::of(1.0F), Floats{}), floats_at(p.alpha));
    if (m.is_textured != 0) textured = textured | seen;
    if (m.coat > 0.0F) p.any_coat = -1;
    if (m.sheen_colour[0] > 0.0F || m.sheen_colour[1] > 0.0F || m.sheen_colour[2] > 0.0F)
      p.any_sheen = -1;
    set(where, m.colour, p.colour);
    set(where, m.emission, p.emission);
    set(where, m.metallic, floats_at(p.metallic));
    set(where, m.roughness, floats_at(p.roughness));
    set(where, m.f0, p.f0);
    set(where, m.f90, floats_at(p.f90));
    set(where, m.sheen_colour, p.sheen_colour);
    set(where, m.sheen_roughness, floats_at(p.sheen_roughness));
    set(where, m.coat, floats_at(p.coat));
    set(where, m.coat_roughness, floats_at(p.coat_roughness));
  }
  masks_at(p.active) = plain;
  p.textured = bits(textured);
}

/// Returns the side of a footprint on the surface's plane, as the ray sees it.
inline Floats3 on_plane(const Floats3& side, const Surfaces& s) {
  const Floats3 normal = vector_at(s.geometric), view = vector_at(s.view);
  Floats cosine = dot(normal, view);
  cosine = select(
      absolute(cosine) < Limits::kGrazing,
      select(cosine < 0.0F, Floats::of(-Limits::kGrazing), Floats::of(Limits::kGrazing)), cosine);
  return side - view * (dot(side, normal) / cosine);
}

/// Projects a side of a footprint onto triangles.
struct Barycentrics {
  Floats3 edge1, edge2, normal;
  Floats scale;  ///< 1 / (area squared times extent)

  explicit Barycentrics(const Primitives& p) {
    const Floats extent = max(largest(p.edge1), largest(p.edge2));
    const Floats shrink = select(p.triangles & (extent > 0.0F), 1.0F / extent, Floats{});
    edge1 = p.edge1 * shrink;
    edge2 = p.edge2 * shrink;
    normal = cross(edge1, edge2);
    const Floats squared = dot(normal, normal);
    scale = select(squared > 0.0F, shrink / squared, Floats{});
  }
  [[nodiscard]] Floats u(const Floats3& side) const {
    return dot(cross(side, edge2), normal) * scale;
  }
  [[nodiscard]] Floats v(const Floats3& side) const {
    return dot(cross(edge1, side), normal) * scale;
  }
};

/// Returns the square of the change of the interpolated normal.
inline Floats turn_of(const Primitives& p, const float (&side)[2][kLanes]) {
  const Floats3 change = (p.normal_b - p.normal_a) * floats_at(side[0]) +
                         (p.normal_c - p.normal_a) * floats_at(side[1]);
  return dot(change, change);
}

/// Projects the footprints onto the surfaces, and finds how much the normals change across them.
inline void set_footprints(const Beam& beam, const Primitives& primitives, const Surfaces& s,
                           Points& p) {
  floats_at(p.bend) = Floats{};
  const Masks curved = primitives.smooth | primitives.spheres | lanes_of(p.textured);
  if (!any(curved & masks_at(p.active))) return;
  const Floats z = dot(spread(beam.depth), vector_at(s.point)) + beam.depth_origin;
  const Floats closer = absolute(1.0F - z * beam.inverse_distance);
  const Floats width = max(beam.lens_mm * closer, beam.subpixels_per_gap * absolute(z));
  const Floats3 across = on_plane(spread(beam.across) * width, s);
  const Floats3 along = on_plane(spread(beam.along) * (beam.row_mm * closer), s);
  const Floats spheres =
      select(primitives.spheres,
             (dot(across, across) + dot(along, along)) / (primitives.radius * primitives.radius),
             Floats{});
  const Barycentrics barycentrics(primitives);
  store(barycentrics.edge1, p.edge1);
  store(barycentrics.edge2, p.edge2);
  floats_at(p.across[0]) = barycentrics.u(across);
  floats_at(p.across[1]) = barycentrics.v(across);
  floats_at(p.along[0]) = barycentrics.u(along);
  floats_at(p.along[1]) = barycentrics.v(along);
  floats_at(p.bend) = select(primitives.smooth,
                             turn_of(primitives, p.across) + turn_of(primitives, p.along), spheres);
}

uint32_t find(const pbr_kernel::Tables& tables, const Beam& beam, const float* packet,
              const int32_t* valid, Surfaces& s, Points& p) {
  const Words& geometry = words_at(packet + packet_kernel::kGeometry * kLanes);
  const Masks met = masks_at(valid) & (geometry != kNoGeometry);
  masks_at(s.active) = met;
  if (!any(met)) return 0;
  Masks numbers{};
  const auto set_material = [&](int32_t number, const Masks& where) {
    numbers = select(where, Masks::of(number), numbers);
  };
  Primitives primitives{};
  find_points(*tables.shapes, packet, met, set_material, primitives, s);
  masks_at(s.material) = numbers;
  set_factors(tables.materials, numbers, s, p);
  const uint32_t lanes = bits(masks_at(p.active));
  if (lanes == 0) return 0;
  set_footprints(beam, primitives, s, p);
  store(vector_at(s.smooth), p.normal);
  store(vector_at(s.smooth), p.coat_normal);
  floats_at(p.spread) = floats_at(p.coat_spread) = Floats{};
  floats_at(p.occlusion) = Floats::of(1.0F);
  return lanes;
}

// ---- textures

using pbr_kernel::AxesInput;
using pbr_kernel::Textures;
using pbr_kernel::Values;

inline const Floats& channel(const Values& values, int c) { return floats_at(values.channel[c]); }
inline Floats3 colour(const Values& values) {
  return {channel(values, 0), channel(values, 1), channel(values, 2)};
}
inline void change(const Masks& where, const Floats& value, float* lanes) {
  floats_at(lanes) = select(where, value, floats_at(lanes));
}
inline void change(const Masks& where, const Floats3& value, float (&lanes)[3][kLanes]) {
  store(select(where, value, vector_at(lanes)), lanes);
}

/// Axes are unit vectors along those of a texture, perpendicular to a normal.
struct Axes {
  Floats3 tangent, bitangent;

  Axes(const Floats3& normal, const Floats3& along) {
    const Masks steep = absolute(normal.x) < 0.6F;
    const Floats3 any_way{select(steep, Floats::of(1.0F), Floats{}),
                          select(steep, Floats{}, Floats::of(1.0F)), Floats{}};
    const Floats3 flat = along - normal * dot(along, normal);
    tangent = unit(select(dot(flat, flat) > 1e-12F, flat, cross(normal, any_way)));
    bitangent = cross(normal, tangent);
  }
};

/// Without tangents of vertices, these are the directions in which the texture's u grows and its v
/// falls (v points down, the bitangent up).
inline Axes axes_of(const AxesInput& input, const Points& p, const Floats3& normal) {
  if (input.vertex != nullptr) {
    Axes axes(normal, unit(colour(*input.vertex)));
    axes.bitangent = axes.bitangent *
                     select(channel(*input.vertex, 3) < 0.0F, Floats::of(-1.0F), Floats::of(1.0F));
    return axes;
  }
  const Floats& u1 = floats_at(input.edge1[0]);
  const Floats& v1 = floats_at(input.edge1[1]);
  const Floats& u2 = floats_at(input.edge2[0]);
  const Floats& v2 = floats_at(input.edge2[1]);
  const Floats area = u1 * v2 - u2 * v1;
  const Floats inverse = select(area != 0.0F, 1.0F / area, Floats{});
  const Floats3 edge1 = vector_at(p.edge1), edge2 = vector_at(p.edge2);
  const Floats3 by_v = (edge2 * u1 - edge1 * u2) * inverse;
  Axes axes(normal, unit((edge1 * v2 - edge2 * v1) * inverse));
  axes.bitangent = select(dot(axes.bitangent, by_v) > 0.0F, -axes.bitangent, axes.bitangent);
  return axes;
}

/// Returns the square of alpha of normals that have a mean vector of this length, as
/// spread_of_normals() of render/shading/pbr_scene.h does.
inline Floats spread_of_normals(const Floats& length) {
  const Floats r = max(min(length, Floats::of(1.0F)), Floats::of(0.1F));
  const Floats squared = r * r;
  return 2.0F * (1.0F - squared) / (r * (3.0F - squared));
}

/// Turns the normals by a normal map.
inline void turn_normals(const Values& map, float scale, const AxesInput& input, const Masks& where,
                         const Surfaces& s, const Points& p, float (&normals)[3][kLanes],
                         float* spreads) {
  const Floats side = select(masks_at(s.outer_side), Floats::of(1.0F), Floats::of(-1.0F));
  const Floats3 front = vector_at(s.smooth) * side;
  const Axes axes = axes_of(input, p, front);
  const Floats3 mean = colour(map);
  const Floats3 turned =
      unit(axes.tangent * (mean.x * scale) + axes.bitangent * (mean.y * scale) + front * mean.z);
  const Masks is_turned = where & nonzero(turned);
  change(is_turned, turned * side, normals);
  change(is_turned, spread_of_normals(root(dot(mean, mean))), spreads);
}

inline Floats alpha_of(const pbr_kernel::Material& m, const Floats& alpha) {
  using pbr_kernel::Material;
  if (m.alpha_mode == Material::kOpaque) return Floats::of(1.0F);
  if (m.alpha_mode == Material::kBlend) return clamp01(alpha);
  return select(alpha < m.alpha_cutoff, Floats{}, Floats::of(1.0F));
}

void apply(const pbr_kernel::Material& m, const Textures& t, const Surfaces& s, Points& p) {
  const Masks where = lanes_of(t.lanes);
  Floats3 base = spread(m.colour);
  Floats alpha = Floats::of(m.alpha);
  const Values* const factors[] = {t.base_colour, t.vertex_colour};
  for (const Values* by : factors)
    if (by != nullptr) {
      base = base * colour(*by);
      alpha = alpha * channel(*by, 3);
    }
  change(where, base, p.colour);
  change(where, alpha_of(m, alpha), p.alpha);
  if (t.metallic_roughness != nullptr) {
    change(where, clamp01(m.roughness * channel(*t.metallic_roughness, 1)), p.roughness);
    change(where, clamp01(m.metallic * channel(*t.metallic_roughness, 2)), p.metallic);
  }
  if (t.occlusion != nullptr)
    change(where, clamp01(1.0F + m.occlusion_strength * (channel(*t.occlusion, 0) - 1.0F)),
           p.occlusion);
  if (t.normal != nullptr)
    turn_normals(*t.normal, m.normal_scale, t.normal_axes, where, s, p, p.normal, p.spread);
  if (t.emission != nullptr) change(where, spread(m.emission) * colour(*t.emission), p.emission);
  if (t.specular != nullptr || t.specular_colour != nullptr) {
    Floats specular = Floats::of(m.specular);
    Floats3 tint = spread(m.specular_colour);
    if (t.specular != nullptr) specular = specular * channel(*t.specular, 3);
    if (t.specular_colour != nullptr) tint = tint * colour(*t.specular_colour);
    const Floats one = Floats::of(1.0F);
    const Floats3 f0 = tint * Floats::of(m.plain_f0);
    change(where, Floats3{min(f0.x, one), min(f0.y, one), min(f0.z, one)} * specular, p.f0);
    change(where, specular, p.f90);
  }
  if (t.sheen_colour != nullptr)
    change(where, spread(m.sheen_colour) * colour(*t.sheen_colour), p.sheen_colour);
  if (t.sheen_roughness != nullptr)
    change(where, clamp01(m.sheen_roughness * channel(*t.sheen_roughness, 3)), p.sheen_roughness);
  if (t.coat != nullptr) change(where, m.coat * channel(*t.coat, 0), p.coat);
  if (t.coat_roughness != nullptr)
    change(where, clamp01(m.coat_roughness * channel(*t.coat_roughness, 1)), p.coat_roughness);
  if (t.coat_normal != nullptr)
    turn_normals(*t.coat_normal, 1.0F, t.coat_axes, where, s, p, p.coat_normal, p.coat_spread);
}

// ---- light of the environment

inline Floats3 to_environment(const Environment& e, const Floats3& d) {
  return {dot(spread(e.right), d), dot(spread(e.up), d), dot(spread(e.back), d)};
}

inline Floats seen_cosine(const Floats& cosine) {
  return min(max(cosine, Floats::of(Limits::kSmallestCosine)), Floats::of(1.0F));
}

/// Returns the roughness of a surface whose shape and normal map vary as well.
inline Floats widened(const Floats& roughness, const Floats& bend, const Floats& spread_of_map) {
  const Floats more = min(bend * kInversePi, Floats::of(Limits::kMostBend)) + spread_of_map;
  const Floats alpha = roughness * roughness;
  const Floats wider = root(root(min(alpha * alpha + more, Floats::of(1.0F))));
  return select(more > 0.0F, wider, roughness);
}

inline uint32_t sharp_lanes(const Masks& lanes, const Floats& roughness) {
  return bits(lanes & (MapPlace(roughness).above == 0));
}

inline void aim_coat(const Environment& e, const Floats3& viewer, const Points& p, Shaded& out) {
  const Floats3 normal = vector_at(p.coat_normal);
  const Floats cosine = dot(normal, viewer);
  floats_at(out.coat_cosine) = seen_cosine(cosine);
  const Floats roughness =
      widened(floats_at(p.coat_roughness), floats_at(p.bend), floats_at(p.coat_spread));
  floats_at(out.coat_roughness) = roughness;
  if (e.is_uniform != 0) return;
  store(to_environment(e, normal * (2.0F * cosine) - viewer), out.coat_mirror);
  out.coat_sharp = sharp_lanes(masks_at(p.active) & (floats_at(p.coat) > 0.0F), roughness);
}

void aim(const pbr_kernel::Tables& tables, const Surfaces& s, const Points& p, Shaded& out) {
  const Environment& e = tables.environment;
  const Floats3 normal = vector_at(p.normal), viewer = -vector_at(s.view);
  const Floats cosine = dot(normal, viewer);
  floats_at(out.view_cosine) = seen_cosine(cosine);
  const Floats roughness = widened(floats_at(p.roughness), floats_at(p.bend), floats_at(p.spread));
  floats_at(out.roughness) = roughness;
  out.sharp = out.coat_sharp = 0;
  if (p.any_coat != 0) aim_coat(e, viewer, p, out);
  if (e.is_uniform != 0) return;
  // Rough lobes lean toward the normal.
  const Floats squared = roughness * roughness;
  const Floats3 mirror = normal * (2.0F * cosine) - viewer;
  store(to_environment(e, mixed(mirror, normal, squared * squared)), out.mirror);
  out.sharp = sharp_lanes(masks_at(p.active), roughness);
}

/// Mirror is the GGX lobe of a metal or of a dielectric.
struct Mirror {
  Floats3 single;    ///< albedo of light that is reflected once
  Floats3 multiple;  ///< albedo of light that is reflected between microfacets

  Mirror(const Floats3& f0, const Floats& f90, const Albedo& albedo)
      : single(f0 * albedo.scale + all(f90 * albedo.bias)) {
    const Floats lost = 1.0F - (albedo.scale + albedo.bias);
    const Floats3 mean = f0 + (all(f90) - f0) * Floats::of(1.0F / 21.0F);
    multiple = quotient(single * mean, all(Floats::of(1.0F)) - mean * lost) * lost;
  }
};

/// Returns the occlusion of mirrored light.
inline Floats mirror_occlusion(const Floats& occlusion, const Floats& cosine,
                               const Floats& roughness) {
  const Masks occluded = occlusion < 1.0F;
  if (!any(occluded)) return Floats::of(1.0F);
  const Floats narrow = exp2_of(-16.0F * roughness - 1.0F);
  return select(occluded, clamp01(power(cosine + occlusion, narrow) - 1.0F + occlusion),
                Floats::of(1.0F));
}

/// Puts the coat over the light of what is below it.
inline void add_coat(const pbr_kernel::Tables& tables, const Points& p, Shaded& out) {
  const Floats cosine = floats_at(out.coat_cosine), roughness = floats_at(out.coat_roughness);
  const Albedo albedo = albedo_at(*tables.albedo, cosine, roughness);
  const Floats share = floats_at(p.coat) * (Limits::kCoatF0 * albedo.scale + albedo.bias);
  const Floats below = 1.0F - share;
  floats_at(out.below_coat) = below;
  const Environment& e = tables.environment;
  const Floats3 mirrored =
      e.is_uniform != 0
          ? spread(e.uniform)
          : mirrored_light(e.mirrored, vector_at(out.coat_mirror), roughness, out.coat_source);
  const Floats seen = mirror_occlusion(floats_at(p.occlusion), cosine, roughness);
  store(vector_at(out.light) * below + mirrored * (share * seen), out.light);
}

void shade(const pbr_kernel::Tables& tables, const Points& p, Shaded& out) {
  const Floats cosine = floats_at(out.view_cosine), roughness = floats_at(out.roughness);
  const Floats metallic = floats_at(p.metallic), f90 = floats_at(p.f90);
  const Floats3 colour = vector_at(p.colour), f0 = vector_at(p.f0);
  const Albedo albedo = albedo_at(*tables.albedo, cosine, roughness);
  const Mirror dielectric(f0, f90, albedo);
  const Floats below =
      (1.0F - metallic) * (1.0F - largest_of(dielectric.single + dielectric.multiple));
  Floats3 single = dielectric.single, multiple = dielectric.multiple;
  store(f0, out.f0);
  floats_at(out.f90) = f90;
  if (any(masks_at(p.active) & (metallic > 0.0F))) {
    const Mirror metal(colour, Floats::of(1.0F), albedo);
    single = mixed(single, metal.single, metallic);
    multiple = mixed(multiple, metal.multiple, metallic);
    store(mixed(f0, colour, metallic), out.f0);
    floats_at(out.f90) = f90 + (1.0F - f90) * metallic;
  }
  store(quotient(single + multiple, single), out.stronger);
  const Floats3 diffuse = colour * below;
  store(diffuse, out.diffuse);

  const Environment& e = tables.environment;
  Floats3 matt = spread(e.uniform), mirrored = matt;
  if (e.is_uniform == 0) {
    matt = light_of(e.diffuse, place_of(to_environment(e, vector_at(p.normal))));
    mirrored = mirrored_light(e.mirrored, vector_at(out.mirror), roughness, out.source);
  }
  const Floats occlusion = floats_at(p.occlusion);
  const Floats seen = mirror_occlusion(occlusion, cosine, roughness);
  Floats3 light = matt * diffuse * occlusion + (mirrored * single + matt * multiple) * seen;
  if (p.any_sheen != 0) {
    const Floats3 tint = vector_at(p.sheen_colour);
    const Floats share = sheen_at(*tables.sheen, cosine, floats_at(p.sheen_roughness));
    floats_at(out.below_sheen) = 1.0F - largest_of(tint) * share;
    light = light * floats_at(out.below_sheen) + tint * matt * (share * occlusion);
  }
  store(vector_at(p.emission) + light, out.light);
  if (p.any_coat != 0) add_coat(tables, p, out);
}

// ---- lights

/// Lobe is what the GGX lobes of one light have in common: cosines to a normal, and the directions.
struct Lobe {
  Floats3 normal, half;
  Floats light, view;
  Floats view_sine_squared;

  /// Returns pi times density times visibility times the cosine of the light.
  [[nodiscard]] Floats value(const Floats& roughness) const {
    const Floats held = max(roughness, Floats::of(Limits::kSmallestRoughness));
    const Floats alpha = held * held, squared = alpha * alpha;
    const Floats3 aside = cross(normal, half);
    const Floats along = dot(normal, half);
    const Floats ratio = 1.0F / (dot(aside, aside) + squared * (along * along));
    const auto masking = [&](const Floats& sine_squared, const Floats& cosine) {
      return root(squared * max(sine_squared, Floats{}) + cosine * cosine);
    };
    const Floats visibility = 0.5F / (light * masking(view_sine_squared, view) +
                                      view * masking(1.0F - light * light, light));
    return light * (squared * (ratio * ratio)) * visibility;
  }
};

/// Returns the share of a light that a coat reflects.
inline Floats of_coat(const Floats3& toward, const Floats3& half, const Floats& grazing,
                      const Points& p, const Shaded& shaded) {
  const Floats3 normal = vector_at(p.coat_normal);
  const Floats cosine = dot(normal, toward), view = floats_at(shaded.coat_cosine);
  const Lobe lobe{normal, half, cosine, view, 1.0F - view * view};
  const Floats fresnel = Limits::kCoatF0 + (1.0F - Limits::kCoatF0) * grazing;
  const Floats share = floats_at(p.coat) * fresnel * lobe.value(floats_at(shaded.coat_roughness));
  return select((cosine > 0.0F) & (floats_at(p.coat) > 0.0F), share, Floats{});
}

/// Returns pi times density times visibility times the cosine of the light, of white sheen.
inline Floats of_sheen(const Lobe& lobe, const Floats& roughness) {
  const Floats held = max(roughness, Floats::of(Limits::kSmallestSheenRoughness));
  const Floats inverse = 1.0F / (held * held);
  const Floats along = dot(lobe.normal, lobe.half);
  const Floats density =
      (1.0F + 0.5F * inverse) * power(max(1.0F - along * along, Floats{}), 0.5F * inverse);
  return lobe.light * density * (0.25F / (lobe.light + lobe.view - lobe.light * lobe.view));
}

/// Returns the share of a light that is reflected toward the viewer.
inline Floats3 reflected(const Floats3& toward, const Surfaces& s, const Points& p,
                         const Shaded& shaded) {
  const Masks before = (dot(vector_at(s.geometric), toward) > 0.0F) & masks_at(p.active);
  if (!any(before)) return {};
  const Floats3 normal = vector_at(p.normal), viewer = -vector_at(s.view);
  const Floats3 half = unit(viewer + toward);
  const Floats grazing = fifth_power(1.0F - clamp01(dot(viewer, half)));
  const Floats cosine = dot(normal, toward), facing = dot(normal, viewer);
  const Lobe lobe{normal, half, cosine, floats_at(shaded.view_cosine), 1.0F - facing * facing};
  const Floats3 fresnel = mixed(vector_at(shaded.f0), all(floats_at(shaded.f90)), grazing);
  Floats3 sum = vector_at(shaded.diffuse) * cosine +
                fresnel * vector_at(shaded.stronger) * lobe.value(floats_at(shaded.roughness));
  if (p.any_sheen != 0)
    sum = sum * floats_at(shaded.below_sheen) +
          vector_at(p.sheen_colour) * of_sheen(lobe, floats_at(p.sheen_roughness));
  sum = select(cosine > 0.0F, sum, Floats3{});
  if (p.any_coat != 0)
    sum = sum * floats_at(shaded.below_coat) + all(of_coat(toward, half, grazing, p, shaded));
  return select(before, sum, Floats3{});
}

void light_rays(const shading_kernel::Light& light, const Surfaces& s, const Points& p,
                const Shaded& shaded, LightRays& out) {
  const Floats3 start = vector_at(s.start);
  const Arrival at = arrival(light, way_to(light, start), Floats::of(1.0F));
  const Floats3 brings = reflected(at.toward, s, p, shaded) * spread(light.colour) * at.intensity;
  NewRays rays;
  rays.packet = out.packet;
  rays.valid = out.valid;
  const Masks wanted = masks_at(p.active) & nonzero(brings);
  write_rays(start, at.toward, at.distance * (1.0F - kLightClearance), wanted, rays);
  out.refused = rays.refused;
  store(brings, out.brings);
}

void tone_map(pbr_kernel::ToneMap map, const float (&light)[3][kLanes], float (&shown)[3][kLanes]) {
  const Floats3 in = vector_at(light);
  store(map == pbr_kernel::ToneMap::kPbrNeutral ? pbr_neutral(in)
        : map == pbr_kernel::ToneMap::kAces     ? aces(in)
                                                : in,
        shown);
}

}  // namespace

extern const pbr_kernel::Kernel kPbrKernel;
const pbr_kernel::Kernel kPbrKernel{.find = find,
                                    .apply = apply,
                                    .aim = aim,
                                    .shade = shade,
                                    .light_rays = light_rays,
                                    .tone_map = tone_map};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
