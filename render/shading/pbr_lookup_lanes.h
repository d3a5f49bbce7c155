// SPDX-License-Identifier: Apache-2.0
// Look-ups of sixteen lanes in the tables of metallic-roughness shading, for the kernel of one
// instruction set.
#pragma once

#include "base/lanes.h"
#include "render/shading/met_primitives.h"
#include "render/shading/pbr_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

/// Four numbers of one lane.
using Four = float __attribute__((vector_size(16)));

inline Four four_at(const float* at) {
  return reinterpret_cast<const Unaligned<Four>*>(at)->v;
}

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

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
