// SPDX-License-Identifier: Apache-2.0
#include "render/textures/texel_kernel.h"

#include "render/accel/packet_kernel_lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using texel_kernel::Area;
using texel_kernel::Content;
using texel_kernel::Corners;
using texel_kernel::kLanes;
using texel_kernel::kPlaces;
using texel_kernel::Level;
using texel_kernel::Lookup;
using texel_kernel::TextureLevels;
using texel_kernel::Values;

// ---- places

/// Ellipses holds the places of look-ups.
struct Ellipses {
  Masks places;     ///< number of places, at equal distances
  Floats along[2];  ///< number of places times the distance from one to the next, as u and v
  Masks level;
  Floats of_coarse;
};

/// Limits a length in texels: at the horizon of a plane, lengths are infinite.
inline Floats held(const Floats& length) {
  constexpr float kLongest = 1e9F;
  return max(min(length, Floats::of(kLongest)), Floats::of(-kLongest));
}

inline Ellipses ellipses_around(const TextureLevels& texture, const Area& area) {
  const auto width = static_cast<float>(texture.levels[0].width);
  const auto height = static_cast<float>(texture.levels[0].height);
  const Floats ax = held(floats_at(area.across[0]) * width);
  const Floats ay = held(floats_at(area.across[1]) * height);
  const Floats bx = held(floats_at(area.along[0]) * width);
  const Floats by = held(floats_at(area.along[1]) * height);
  // Eigenvalues of the sum of the outer products of both sides.
  const Floats xx = ax * ax + bx * bx, yy = ay * ay + by * by, xy = ax * ay + bx * by;
  const Floats half = 0.5F * (xx - yy);
  const Floats apart = root(half * half + xy * xy);
  const Floats major = root(0.5F * (xx + yy) + apart);
  // The product of both axes is the area, which the difference would lose to rounding.
  const Floats minor = select(major > 0.0F, absolute(ax * by - ay * bx) / major, Floats{});
  const Floats wide = max(max(minor, major * (1.0F / kPlaces)), Floats::of(1.0F));

  constexpr float kMore = 1e-5F;  // rounding must not add a place
  const Floats longer = major / wide - kMore;
  const Masks whole = to_integers(longer);
  const Masks several = longer > 1.0F;
  Ellipses out;
  out.places = select(several, whole - (to_floats(whole) < longer), Masks::of(1));
  const Masks flat = xx >= yy;
  const Floats x = select(flat, half + apart, xy), y = select(flat, xy, apart - half);
  const Floats size = root(x * x + y * y);
  const Floats scale = select(several & (size > 0.0F), major / size, Floats{});
  out.along[0] = x * scale * (1.0F / width);
  out.along[1] = y * scale * (1.0F / height);

  const Floats depth = min(log2_of(wide), Floats::of(static_cast<float>(texture.count - 1)));
  out.level = to_integers(depth);
  out.of_coarse = depth - to_floats(out.level);
  return out;
}

/// Returns the next lower integer of a number below 2^50.
inline double lower_integer(double v) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: additions round to integers
  const double near = (v + kShift) - kShift;
  return near > v ? near - 1.0 : near;
}

/// Moves coordinates into the picture, 0 to 1.
inline void move_into_picture(bool repeats, bool mirrors, double (&c)[kLanes]) {
  for (double& v : c) v = v < 1e15 && v > -1e15 ? v : 0.0;
  if (!repeats) {
    for (double& v : c) v = v > 0.0 ? (v < 1.0 ? v : 1.0) : 0.0;
  } else if (!mirrors) {
    for (double& v : c) v -= lower_integer(v);
  } else {
    for (double& v : c) {
      const double pair = 2.0 * (0.5 * v - lower_integer(0.5 * v));
      v = pair > 1.0 ? 2.0 - pair : pair;
    }
  }
}

/// The two texels of a row or a column around each place.
struct Pair {
  int32_t first[kLanes], second[kLanes];
};

/// Texels are counted from half a texel before the first texel, so that truncation rounds down.
inline void find_pair(const double (&c)[kLanes], const int32_t (&size)[kLanes], bool wraps,
                      Pair& out, float (&part)[kLanes]) {
  for (int r = 0; r < kLanes; ++r) {
    const double texel = c[r] * size[r] + 0.5;
    const auto whole = static_cast<int32_t>(texel);
    part[r] = static_cast<float>(texel - whole);
    const int32_t last = size[r] - 1;
    out.first[r] = whole > 0 ? whole - 1 : (wraps ? last : 0);
    out.second[r] = whole <= last ? whole : (wraps ? 0 : last);
  }
}

/// Sizes of the level of each lane.
struct LevelSizes {
  int32_t of[2][kLanes];  ///< width and height

  LevelSizes(const TextureLevels& texture, const Masks& level) {
    for (int r = 0; r < kLanes; ++r) {
      of[0][r] = texture.levels[level[r]].width;
      of[1][r] = texture.levels[level[r]].height;
    }
  }
};

inline void find_corners(const TextureLevels& texture, const LevelSizes& sizes,
                         const double (&place)[2][kLanes], Corners& out) {
  // A mirrored border continues as an extended one does.
  const auto wraps = [&](int k) { return texture.repeat[k] != 0 && texture.mirror[k] == 0; };
  Pair column, row;
  find_pair(place[0], sizes.of[0], wraps(0), column, out.right);
  find_pair(place[1], sizes.of[1], wraps(1), row, out.below);
  for (int r = 0; r < kLanes; ++r) {
    const int32_t upper = row.first[r] * sizes.of[0][r], lower = row.second[r] * sizes.of[0][r];
    out.texel[0][r] = upper + column.first[r];
    out.texel[1][r] = upper + column.second[r];
    out.texel[2][r] = lower + column.first[r];
    out.texel[3][r] = lower + column.second[r];
  }
}

/// Returns the number of the next level of each lane.
inline Masks coarser(const TextureLevels& texture, const Masks& level) {
  return clamp_index(level + 1, Masks::of(texture.count));
}

/// Finder sets the corners of places in both levels of a look-up.
struct Finder {
  const TextureLevels& texture;
  Lookup& out;
  LevelSizes fine, coarse;

  Finder(const TextureLevels& of, const Masks& level, const Floats& of_coarse, Lookup& lookup)
      : texture(of), out(lookup), fine(of, level), coarse(of, coarser(of, level)) {
    masks_at(out.level) = level;
    floats_at(out.of_coarse) = of_coarse;
    out.any_coarse = any(of_coarse > 0.0F) ? 1 : 0;
  }
  void set(int number, double (&place)[2][kLanes]) const {
    for (int k = 0; k < 2; ++k)
      move_into_picture(texture.repeat[k] != 0, texture.mirror[k] != 0, place[k]);
    find_corners(texture, fine, place, out.fine[number]);
    if (out.any_coarse != 0) find_corners(texture, coarse, place, out.coarse[number]);
  }
};

void find(const TextureLevels& texture, const Area& area, Lookup& out) {
  const Ellipses ellipses = ellipses_around(texture, area);
  const Finder finder(texture, ellipses.level, ellipses.of_coarse, out);
  masks_at(out.places) = ellipses.places;
  alignas(64) float along[2][kLanes], share[kLanes];
  for (int k = 0; k < 2; ++k) floats_at(along[k]) = ellipses.along[k];
  floats_at(share) = 1.0F / to_floats(ellipses.places);
  for (int n = 0; n < kPlaces && any(ellipses.places > n); ++n) {
    double place[2][kLanes];
    for (int k = 0; k < 2; ++k)
      for (int r = 0; r < kLanes; ++r)
        place[k][r] =
            area.middle[k][r] + double{along[k][r]} * ((n + 0.5) * double{share[r]} - 0.5);
    finder.set(n, place);
  }
}

// ---- means

/// The four channels of a texel, and those of a texel and the one below it.
using Four = float __attribute__((vector_size(16)));
using Eight = float __attribute__((vector_size(32)));
using EightCodes = int32_t __attribute__((vector_size(32)));

constexpr EightCodes kIsAlpha = {0, 0, 0, -1, 0, 0, 0, -1};

// Vectors are passed by reference: their registers differ between instruction sets.

inline void load_codes(const uint8_t* upper, const uint8_t* lower, EightCodes& out) {
#if defined(__AVX2__)
  uint32_t words[2];
  __builtin_memcpy(&words[0], upper, 4);
  __builtin_memcpy(&words[1], lower, 4);
  const auto both = static_cast<int64_t>(uint64_t{words[1]} << 32 | words[0]);
  out = reinterpret_cast<EightCodes>(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(both)));
#else
  for (int c = 0; c < 4; ++c) {
    out[c] = upper[c];
    out[4 + c] = lower[c];
  }
#endif
}

/// Replaces the channels of colour by those of a table.
inline void look_up(const float* table, const EightCodes& codes, Eight& out) {
#if defined(__AVX2__)
  const Eight is_colour = reinterpret_cast<Eight>(~kIsAlpha);
  out = _mm256_mask_i32gather_ps(out, table, reinterpret_cast<__m256i>(codes), is_colour, 4);
#else
  for (int c = 0; c < 8; ++c) out[c] = kIsAlpha[c] != 0 ? out[c] : table[codes[c]];
#endif
}

inline void take_root(Eight& of) {
#if defined(__AVX2__)
  of = _mm256_sqrt_ps(of);
#else
  for (int c = 0; c < 8; ++c) of[c] = __builtin_sqrtf(of[c]);
#endif
}

/// Makes mean vectors of two texels of a normal map, as MipMaps::texel() does.
inline void make_vectors(bool is_first, Eight& texels) {
  const Eight vector = 2.0F * texels - 1.0F;
  const Eight square = vector * vector;
  const Eight x = __builtin_shufflevector(square, square, 0, 0, 0, 0, 4, 4, 4, 4);
  const Eight y = __builtin_shufflevector(square, square, 1, 1, 1, 1, 5, 5, 5, 5);
  const Eight z = __builtin_shufflevector(square, square, 2, 2, 2, 2, 6, 6, 6, 6);
  const Eight size_squared = x + y + z;
  const Eight one = Eight{} + 1.0F;
  if (!is_first) {
    // Levels hold unit vectors, but for the rounding of 8-bit codes: Taylor's series around 1 is
    // within 1e-6.
    const Eight spread = __builtin_shufflevector(texels, texels, 3, 3, 3, 3, 7, 7, 7, 7);
    const Eight more = size_squared - one;
    texels = vector * ((one - spread * spread) * (one - more * (0.5F - 0.375F * more)));
    return;
  }
  Eight size = size_squared;
  take_root(size);
  constexpr Eight kUpright = {0, 0, 1, 0, 0, 0, 1, 0};
  texels = size > 0.0F ? vector * (one / size) : kUpright;
}

template <Content content>
inline void load(const float* light_of_code, const Level& level, int32_t upper, int32_t lower,
                 Eight& out) {
  if (level.codes == nullptr) {
    __builtin_memcpy(&out, level.values + 4 * int64_t{upper}, sizeof out / 2);
    __builtin_memcpy(reinterpret_cast<float*>(&out) + 4, level.values + 4 * int64_t{lower},
                     sizeof out / 2);
  } else {
    EightCodes codes;
    load_codes(level.codes + 4 * int64_t{upper}, level.codes + 4 * int64_t{lower}, codes);
    out = __builtin_convertvector(codes, Eight) / 255.0F;
    if constexpr (content == Content::Colour) look_up(light_of_code, codes, out);
  }
  if constexpr (content == Content::Normals) make_vectors(level.is_first != 0, out);
}

template <Content content>
inline void bilinear(const float* light_of_code, const Level& level, const Corners& at, int lane,
                     Four& out) {
  Eight left, right;
  load<content>(light_of_code, level, at.texel[0][lane], at.texel[2][lane], left);
  load<content>(light_of_code, level, at.texel[1][lane], at.texel[3][lane], right);
  const Eight mixed = left + (right - left) * at.right[lane];
  Four upper, lower;
  __builtin_memcpy(&upper, &mixed, sizeof upper);
  __builtin_memcpy(&lower, reinterpret_cast<const float*>(&mixed) + 4, sizeof lower);
  out = upper + (lower - upper) * at.below[lane];
}

template <Content content>
void mean_of(const TextureLevels& texture, const Lookup& lookup, Values& out) {
  for (int r = 0; r < kLanes; ++r) {
    const int32_t number = lookup.level[r], places = lookup.places[r];
    const Level& fine = texture.levels[number];
    const float of_coarse = lookup.of_coarse[r];
    Four sum{};
    for (int n = 0; n < places; ++n) {
      Four value;
      bilinear<content>(texture.light_of_code, fine, lookup.fine[n], r, value);
      if (of_coarse > 0.0F) {
        Four blurred;
        bilinear<content>(texture.light_of_code, (&fine)[1], lookup.coarse[n], r, blurred);
        value = value + (blurred - value) * of_coarse;
      }
      sum += value;
    }
    sum *= places > 0 ? 1.0F / static_cast<float>(places) : 0.0F;
    for (int c = 0; c < 4; ++c) out.channel[c][r] = sum[c];
  }
}

void mean(const TextureLevels& texture, const Lookup& lookup, Values& out) {
  const auto of_content = texture.content == Content::Colour ? mean_of<Content::Colour>
                          : texture.content == Content::Data ? mean_of<Content::Data>
                                                             : mean_of<Content::Normals>;
  of_content(texture, lookup, out);
}

}  // namespace

extern const texel_kernel::Kernel kTexelKernel;
const texel_kernel::Kernel kTexelKernel{.find = find, .mean = mean};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
