// SPDX-License-Identifier: Apache-2.0
#include "render/textures/texel_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using texel_kernel::Content;
using texel_kernel::Corners;
using texel_kernel::Level;
using texel_kernel::Lookup;
using texel_kernel::Path;

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
  Eight size = x + y + z;
  take_root(size);
  const Eight spread = __builtin_shufflevector(texels, texels, 3, 3, 3, 3, 7, 7, 7, 7);
  const Eight one = Eight{} + 1.0F;
  const Eight held = is_first ? one : one - spread * spread;
  const Eight upright = __builtin_shufflevector(held, Eight{}, 8, 8, 2, 8, 8, 8, 6, 8);
  texels = size > 0.0F ? vector * (held / size) : upright;
}

/// The coordinates u and v in the finer level, and those in the coarser one.
using Coordinates = double __attribute__((vector_size(32)));
using Signs = int64_t __attribute__((vector_size(32)));
using Texels = int32_t __attribute__((vector_size(16)));

inline void truncate(Coordinates& c) {
#if defined(__AVX2__)
  c = _mm256_round_pd(c, _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC);
#else
  for (int k = 0; k < 4; ++k) c[k] = static_cast<double>(static_cast<int64_t>(c[k]));
#endif
}

/// Replaces coordinates by their distance above the next lower integer.
inline void keep_fraction(Coordinates& c) {
  Coordinates whole = c;
  truncate(whole);
  c -= whole;
  c = c < 0.0 ? c + 1.0 : c;
}

/// Wraps holds how a texture continues beyond its border.
struct Wraps {
  Signs repeats, mirrors;
  Texels before, behind;  ///< texels beyond the first and beyond the last one
};

/// Moves coordinates into the picture, 0 to 1.
inline void move_into_picture(const Wraps& wraps, Coordinates& c) {
  const Coordinates above = c < 0.0 ? -c : c;
  c = above < 1e15 ? c : Coordinates{};
  Coordinates fraction = c, pair = 0.5 * c;
  keep_fraction(fraction);
  keep_fraction(pair);
  pair = 2.0 * pair;
  const Coordinates mirrored = pair > 1.0 ? 2.0 - pair : pair;
  const Coordinates positive = c > 0.0 ? c : Coordinates{};
  const Coordinates held = positive < 1.0 ? positive : Coordinates{} + 1.0;
  c = wraps.repeats != 0 ? (wraps.mirrors != 0 ? mirrored : fraction) : held;
}

inline void set_corners(const Texels& first, const Texels& second, const double* part, int level,
                        int32_t width, Corners& out) {
  const int u = 2 * level, v = u + 1;
  const int32_t upper = first[v] * width, lower = second[v] * width;
  out = {{upper + first[u], upper + second[u], lower + first[u], lower + second[u]},
         static_cast<float>(part[u]),
         static_cast<float>(part[v])};
}

void find(const Path& path, Lookup& lookup) {
  const Texels size = {path.fine_size[0], path.fine_size[1], path.coarse_size[0],
                       path.coarse_size[1]};
  const Coordinates sizes = __builtin_convertvector(size, Coordinates);
  const Coordinates middle = {path.middle[0], path.middle[1], path.middle[0], path.middle[1]};
  const Coordinates length = {path.length[0], path.length[1], path.length[0], path.length[1]};
  Wraps wraps{{path.repeat[0], path.repeat[1], path.repeat[0], path.repeat[1]},
              {path.mirror[0], path.mirror[1], path.mirror[0], path.mirror[1]},
              {},
              size - 1};
  // A mirrored border continues as an extended one does.
  for (int k = 0; k < 4; ++k)
    if (wraps.repeats[k] != 0 && wraps.mirrors[k] == 0) {
      wraps.before[k] = size[k] - 1;
      wraps.behind[k] = 0;
    }
  for (int n = 0; n < lookup.places; ++n) {
    Coordinates place = middle + length * ((n + 0.5) / lookup.places - 0.5);
    move_into_picture(wraps, place);
    // Texels are counted from half a texel before the first texel, so that truncation rounds down.
    const Coordinates texel = place * sizes + 0.5;
    Coordinates whole = texel;
    truncate(whole);
    double part[4];
    const Coordinates beyond = texel - whole;
    __builtin_memcpy(part, &beyond, sizeof part);
    Texels second = __builtin_convertvector(whole, Texels);
    Texels first = second - 1;
    first = first < 0 ? wraps.before : first;
    second = second >= size ? wraps.behind : second;
    set_corners(first, second, part, 0, size[0], lookup.fine[n]);
    if (lookup.of_coarse > 0.0F) set_corners(first, second, part, 1, size[2], lookup.coarse[n]);
  }
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
inline void bilinear(const float* light_of_code, const Level& level, const Corners& at, Four& out) {
  Eight left, right;
  load<content>(light_of_code, level, at.texel[0], at.texel[2], left);
  load<content>(light_of_code, level, at.texel[1], at.texel[3], right);
  const Eight mixed = left + (right - left) * at.right;
  Four upper, lower;
  __builtin_memcpy(&upper, &mixed, sizeof upper);
  __builtin_memcpy(&lower, reinterpret_cast<const float*>(&mixed) + 4, sizeof lower);
  out = upper + (lower - upper) * at.below;
}

template <Content content>
void mean_of(const float* light_of_code, const Level& fine, const Level& coarse,
             const Lookup& lookup, float* out) {
  Four sum{};
  for (int n = 0; n < lookup.places; ++n) {
    Four value;
    bilinear<content>(light_of_code, fine, lookup.fine[n], value);
    if (lookup.of_coarse > 0.0F) {
      Four blurred;
      bilinear<content>(light_of_code, coarse, lookup.coarse[n], blurred);
      value = value + (blurred - value) * lookup.of_coarse;
    }
    sum += value;
  }
  sum *= 1.0F / static_cast<float>(lookup.places);
  __builtin_memcpy(out, &sum, sizeof sum);
}

void mean(Content content, const float* light_of_code, const Level& fine, const Level& coarse,
          const Lookup& lookup, float* out) {
  const auto of_content = content == Content::Colour ? mean_of<Content::Colour>
                          : content == Content::Data ? mean_of<Content::Data>
                                                     : mean_of<Content::Normals>;
  of_content(light_of_code, fine, coarse, lookup, out);
}

}  // namespace

extern const texel_kernel::Kernel kTexelKernel;
const texel_kernel::Kernel kTexelKernel{.find = find, .mean = mean};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
