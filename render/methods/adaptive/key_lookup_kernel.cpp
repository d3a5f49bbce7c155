// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/key_lookup_kernel.h"

#include "render/accel/packet_kernel_lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lookup_kernel;

#if defined(__AVX512F__)
// Masked intrinsics, since compilers report the unused operand of the unmasked ones as
// uninitialised.
constexpr auto kAllLanes = static_cast<__mmask16>(~0U);
#endif

inline Masks gather(const uint32_t* table, const Masks& index) {
  Masks out;
#if defined(__AVX512F__)
  const __m512i all = _mm512_mask_i32gather_epi32(
      _mm512_setzero_si512(), kAllLanes, reinterpret_cast<__m512i>(index.part[0]), table, 4);
  out.part[0] = reinterpret_cast<MaskVector>(all);
#else
  for (int p = 0; p < kParts; ++p)
    for (int r = 0; r < kWidth; ++r) out.part[p][r] = static_cast<int32_t>(table[index.part[p][r]]);
#endif
  return out;
}

/// Pairs of values from the left in the lower half, from the right in the upper half.
struct Pairs {
  Masks above, below;
};

inline Pairs gather_corners(const Corners* table, const Masks& index) {
  static_assert(sizeof(Corners) == 8);
  Pairs out;
#if defined(__AVX512F__)
  constexpr __mmask8 kEight = 0xff, kFour = 0xf;
  const auto all = reinterpret_cast<__m512i>(index.part[0]);
  const auto gather_eight = [&](const __m256i& at) {
    return _mm512_mask_i32gather_epi64(_mm512_setzero_si512(), kEight, at, table, 8);
  };
  const __m512i low = gather_eight(_mm512_maskz_extracti64x4_epi64(kFour, all, 0));
  const __m512i high = gather_eight(_mm512_maskz_extracti64x4_epi64(kFour, all, 1));
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  const __m512i odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
  out.above.part[0] = reinterpret_cast<MaskVector>(_mm512_permutex2var_epi32(low, even, high));
  out.below.part[0] = reinterpret_cast<MaskVector>(_mm512_permutex2var_epi32(low, odd, high));
#else
  for (int p = 0; p < kParts; ++p)
    for (int r = 0; r < kWidth; ++r) {
      const Corners& at = table[index.part[p][r]];
      out.above.part[p][r] =
          static_cast<int32_t>(at.above[0] | static_cast<uint32_t>(at.above[1]) << 16);
      out.below.part[p][r] =
          static_cast<int32_t>(at.below[0] | static_cast<uint32_t>(at.below[1]) << 16);
    }
#endif
  return out;
}

/// Place is the position of a subpixel's point in one view.
struct Place {
  Masks odd;    ///< parity of the view's number
  Masks index;  ///< index of the cell's left column, in a row of samples
  Floats part;  ///< weight of the cell's right column
  Masks inside;
};

inline Place place_in(const Grid& grid, const Masks& cache_view, const Floats& x_panel) {
  const Masks odd = (cache_view & 1) == 1;
  const Floats shifted = select(odd, Floats::of(0.5F), Floats{});
  const Floats column = (x_panel - grid.x_first) * grid.columns_per_mm + shifted;
  const Masks inside = (column >= 0.0F) & (column < static_cast<float>(grid.columns - 1));
  const Masks whole = select(inside, to_integers(select(inside, column, Floats{})), Masks{});
  return {odd, cache_view * grid.stride + whole, column - to_floats(whole), inside};
}

inline Floats mix(const Floats& a, const Floats& b, const Floats& part) {
  return a + (b - a) * part;
}
inline Floats along(const Masks& pair, const Floats& part) {
  return mix(to_floats(pair & 0xffff), to_floats((pair >> 16) & 0xffff), part);
}

inline Floats value_at(const SampleRows& interval, const Place& place, const Masks& plane) {
  const Floats part = select(place.odd, Floats::of(interval.part[1]), Floats::of(interval.part[0]));
  const Pairs corners = gather_corners(interval.corners, plane + place.index);
  return mix(along(corners.above, place.part), along(corners.below, place.part), part);
}

/// Writes values from 0 to 255.
inline void write(const Masks& values, uint8_t* out) {
#if defined(__AVX512F__)
  _mm_storeu_si128(
      reinterpret_cast<__m128i*>(out),
      _mm512_maskz_cvtepi32_epi8(kAllLanes, reinterpret_cast<__m512i>(values.part[0])));
#elif defined(__AVX2__)
  const auto low = reinterpret_cast<__m256i>(values.part[0]);
  const auto high = reinterpret_cast<__m256i>(values.part[1]);
  // Packing works within 128-bit halves: lanes 0-3, 8-11, 4-7 and 12-15 are in this order.
  const __m256i words = _mm256_packs_epi32(low, high);
  const __m256i ordered = _mm256_permute4x64_epi64(words, 0xd8);
  _mm_storeu_si128(
      reinterpret_cast<__m128i*>(out),
      _mm_packus_epi16(_mm256_castsi256_si128(ordered), _mm256_extracti128_si256(ordered, 1)));
#elif defined(LENTICULE_NEON)
  const auto words = [&](int p) {
    return vcombine_s16(vqmovn_s32(reinterpret_cast<int32x4_t>(values.part[p])),
                        vqmovn_s32(reinterpret_cast<int32x4_t>(values.part[p + 1])));
  };
  vst1q_u8(out, vcombine_u8(vqmovun_s16(words(0)), vqmovun_s16(words(2))));
#else
  for (int r = 0; r < kLanes; ++r) out[r] = static_cast<uint8_t>(values[r]);
#endif
}

/// Places holds the positions of sixteen points in the two views next to theirs.
struct Places {
  Masks left;
  Floats part;
  Place a, b;
};

inline void write(const Places& places, int at, const Found& out) {
  store(places.left, out.left + at);
  store(clamp01(places.part), out.of_right + at);
  store(select(places.a.inside, places.a.index, Masks::of(-1)), out.cell[0] + at);
  store(select(places.b.inside, places.b.index, Masks::of(-1)), out.cell[1] + at);
  store(places.a.part, out.part[0] + at);
  store(places.b.part, out.part[1] + at);
}

inline Places places_of(const Grid& grid, const Row& row, int at, const Masks& seen) {
  const Floats x = load(row.x + at), tan = load(row.tan + at);
  const Floats z = select(seen, load(row.z + at), Floats{});
  // The point (x + tan z, z) is seen from e at across - e depth.
  const Floats wider = 1.0F / (1.0F - z * grid.inverse_z);
  const Floats across = (x + tan * z) * wider;
  const Floats depth = grid.distance > 0.0F ? z * wider * grid.inverse_z : z;
  const Floats eye = grid.distance > 0.0F ? x + tan * grid.distance : tan;
  const Floats cache_view = (eye - grid.eye_first) * grid.cache_views_per_eye;
  const Masks left =
      clamp_index(to_integers(max(cache_view, Floats{})), Masks::of(grid.cache_views - 1));
  const Floats part = cache_view - to_floats(left);

  const Floats first = across - (grid.eye_first + to_floats(left) * grid.eye_step) * depth;
  return {left, part, place_in(grid, left, first),
          place_in(grid, left + 1, first - depth * grid.eye_step)};
}

/// Looks up the colours of sixteen subpixels; `plane` is the start of each subpixel's channel.
inline void look_up_lanes(const Grid& grid, const SampleRows& interval, const Row& row, int at,
                          const Masks& plane, const Found& out) {
  const Masks cut = load(row.cut + at);
  const Masks seen = cut >= 0;
  if (!any(seen)) {
    write(Masks::of(kNothing), out.states + at);
    return;
  }
  const Masks group = gather(row.group, select(seen, cut, Masks{})) & seen;
  const Places places = places_of(grid, row, at, seen);
  const Place &a = places.a, &b = places.b;
  const Floats& part = places.part;
  const Masks key_a = gather(interval.key, a.index) & a.inside;
  const Masks key_b = gather(interval.key, b.index) & b.inside;
  const Masks in_a = (key_a == group) & seen, in_b = (key_b == group) & seen;
  if (!any(in_a | in_b)) {
    write(select(seen, Masks::of(kUnknown), Masks::of(kNothing)), out.states + at);
    write(places, at, out);
    return;
  }
  const Floats from_a = value_at(interval, a, plane);
  const Floats from_b = value_at(interval, b, plane);

  const Masks both = in_a & in_b;
  const Masks agree = both & (absolute(from_a - from_b) <= row.most_apart);
  // If the other view does not see the surface, one view suffices for view-independent surfaces,
  // and for view-dependent ones if the view is near.
  const Masks any_view = (group & 1) == 0;
  const Masks uneven = group | static_cast<int32_t>(kUneven);
  const Masks only_a = in_a & ~in_b & (key_b != uneven) & (any_view | (part < grid.near));
  const Masks only_b = in_b & ~in_a & (key_a != uneven) & (any_view | (part > 1.0F - grid.near));
  Floats value = mix(from_a, from_b, part);
  value = select(only_a, from_a, select(only_b, from_b, value));
  const Masks found = agree | only_a | only_b;
  const Floats held = min(max(value, Floats{}), Floats::of(255.0F * kCodeParts));
  write(to_integers(held * (1.0F / kCodeParts) + 0.5F), out.codes + at);
  write(select(found, Masks::of(kFound), select(seen, Masks::of(kUnknown), Masks::of(kNothing))),
        out.states + at);
  if (any(seen & ~found)) write(places, at, out);
}

void look_up(const Grid& grid, const SampleRows& interval, const Row& row, const Found& out) {
  Masks plane[3];
  for (int turn = 0; turn < 3; ++turn) {
    int32_t lanes[kLanes];
    for (int r = 0; r < kLanes; ++r) lanes[r] = (turn * kLanes + r) % 3 * interval.plane;
    plane[turn] = load(lanes);
  }
  for (int at = 0, turn = 0; at < row.count; at += kLanes, turn = turn == 2 ? 0 : turn + 1)
    look_up_lanes(grid, interval, row, at, plane[turn], out);
}

}  // namespace

extern const lookup_kernel::Kernel kLookupKernel;
const lookup_kernel::Kernel kLookupKernel{.look_up = look_up};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
