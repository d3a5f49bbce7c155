// SPDX-License-Identifier: Apache-2.0
// The interface of the inner loops of the fast weaver. Plain data only: the kernels are compiled
// for several instruction sets and must not bring shared inline functions into them. All kernels
// compute the same integers, bit for bit.
//
// In units of 2^-15, with mix(a, b, w) = a + ((b - a) w + 2^14 >> 15), a subpixel's light is
//    mix(P(a), P(a + 1), wv), where P(v) = mix(mix(L00, L10, wy), mix(L01, L11, wy), wx)
// of the light Lcr of view v at column x0 + c, row y0 + r. Mixing equal values gives exactly the
// same value; a weight of 0 contributes exactly nothing.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/cpu.h"

namespace lenticule::frames::weave_kernel {

inline constexpr int kRows = 4;        ///< panel rows of a block
inline constexpr int kRun = 8;         ///< largest number of subpixels in a run
inline constexpr int kViewLanes = 64;  ///< most views of the permuting kernels
inline constexpr int kViewBits = 20;   ///< fraction bits of a view number
inline constexpr int kWeightBits = 15;
inline constexpr int kSlopeBits = 3;  ///< additional bits for the change of a column along a run

/// Quad is a plan record for one lens in four rows: per row a run of subpixels under the lens,
/// along which view number and picture column change smoothly. Subpixel n of a run:
///    view = clamp(view[r] + n (step + view_step)), column = column[r], its weight
///    share[r] + (n column_step[r] + n n column_bend >> kSlopeBits).
struct Quad {
  int32_t view[kRows];    ///< 2^-kViewBits views
  uint16_t share[kRows];  ///< 2^-15 columns
  uint16_t column[kRows];
  uint16_t at[kRows];  ///< first place in the set
  int16_t column_step[kRows];
  int16_t view_step;
  int16_t column_bend;
  /// Number of subpixels, four bits per row. In a row without a run, `at` lies behind the last
  /// place.
  uint16_t counts;
  uint16_t colours;  ///< value at[r] mod 3, two bits per row
};
static_assert(sizeof(Quad) == 56);

/// Set holds the records of four rows whose subpixels have one height in each row: places first,
/// first + stride, ...
struct Set {
  uint32_t first;            ///< subpixel of place 0
  uint32_t stride;           ///< 1, or a multiple of 3: one colour only
  int32_t row[kRows];        ///< upper picture row
  int16_t row_share[kRows];  ///< 2^-15 of a row toward the next
  uint32_t quads_begin, quads_end;
};

/// Spot is the Gaussian view filter: for each fraction of a view number, in 2^-bits, the weights of
/// `taps` views, starting `reach` left of the number's integer part. Views that do not exist are
/// ignored.
struct Spot {
  const uint16_t* weights;  ///< null: no such filter. Eight more entries than are used can be read
  int taps, reach, bits, views;
};

/// Terms holds the values that are constant for a whole frame.
struct Terms {
  int32_t view_step;           ///< nominal, added to the step of every record
  int32_t view_most;           ///< view numbers are clamped to 0..view_most
  int32_t weight_mask;         ///< 0x7fff, or 0: no mixing of views
  bool blue_first;             ///< the first of three places is blue
  const uint16_t* light;       ///< light of codes, 256 entries
  const uint8_t* codes;        ///< codes of light, 32768 entries
  const uint8_t* light_curve;  ///< LightCurve: five times 16
  const int16_t* curve;        ///< EncodingCurve: four times 64
  Spot spot;
};

/// Pictures locates the views: pixel (column, row) of view k is at first[k] + row * stride + 3
/// column. There are as many pointers as lanes; the pointers after the last view repeat it.
struct Pictures {
  const uint8_t* const* first;
  size_t stride;
  int views, width, height;
};

/// Target is the output of mixing the records of a set: kRows rows of values, by subpixel. Up to
/// kRun - 1 values behind a run are overwritten.
struct Target {
  uint16_t* light;  ///< output of all other kernels
  uint8_t* codes;   ///< output of the permuting kernels
  size_t stride;
};

void mix_set_plainly(const Terms& terms, const Pictures& pictures, const Set& set,
                     const Quad* quads, const Target& target) noexcept;
/// Converts `count` values of light to code values.
void encode_plainly(const Terms& terms, const uint16_t* light, size_t count,
                    uint8_t* codes) noexcept;

/// TransposedRows holds the transposed picture rows of a set, with the views side by side, as
/// turn_light() or transpose_row() wrote them; aligned to 64.
struct TransposedRows {
  const void* upper[kRows];
  const void* lower[kRows];
  size_t lanes;
};

/// The lanes of an entry are a multiple of kLaneStep; the lanes after the last view repeat it.
inline constexpr size_t kLaneStep = 16;

/// RunKernel mixes runs of transposed picture rows in linear light, for every rig.
struct RunKernel {
  /// Transposes a picture row: puts the light of its views side by side. Entry (3 column + channel)
  /// lanes + view is two words, the light at the column and at the next column. There are as many
  /// pointers to views as lanes.
  void (*turn_light)(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                     uint16_t* light) noexcept;
  void (*mix_set)(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad* quads,
                  const Target& target) noexcept;
};

/// The following mix by permuting bytes, for at most kViewLanes views and sets of stride 1.
/// transpose_row() puts the codes of a picture row's views side by side: width + 1 pixels, the last
/// one twice, of `lanes` views, each of three codes in the order of the places' colours and a byte
/// without meaning. Lanes after the last view hold anything.
void transpose_row(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                   uint8_t* transposed) noexcept;
/// mix_set_by_permuting() also encodes: it writes codes.
void mix_set_by_permuting(const Terms& terms, const TransposedRows& rows, const Set& set,
                          const Quad* quads, const Target& target) noexcept;
/// Copies a row of codes past the caches, if `to` begins with a cache line. end_streaming() must
/// follow before another thread may read the row.
void stream_row(const uint8_t* codes, size_t count, uint8_t* to) noexcept;
void end_streaming() noexcept;

}  // namespace lenticule::frames::weave_kernel

namespace lenticule::frames {
LENTICULE_DECLARE_KERNEL(weave_kernel::RunKernel, kRunKernel)
}
