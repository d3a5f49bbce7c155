// SPDX-License-Identifier: Apache-2.0
// Inner loop of method adaptive, compiled once per instruction set: looks up the subpixels of a row
// in the cache views. Plain data only.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/shading/shading_kernel.h"

namespace lenticule::render::lookup_kernel {

inline constexpr int kLanes = 16;
/// Unit of samples: fractions of a code value.
using render::kCodeParts;

/// Grid holds the cache views of one rig; lengths in millimetres, or tangents if rays are parallel.
/// The samples of odd views lie half a column to the left of those of even views.
struct Grid {
  float x_first;
  float columns_per_mm;
  float eye_first;
  float eye_step;
  float cache_views_per_eye;
  float near;       ///< distance, as part of a step, at which one view suffices if shiny
  float inverse_z;  ///< 1 / Z, 0 if rays are parallel
  float distance;   ///< Z, 0 if rays are parallel
  int cache_views;
  int columns;
  int stride;
};

/// Set in the key of a cell whose corners show one surface but differ in colour.
inline constexpr uint32_t kUneven = 0x80000000U;

/// Corners holds the code values, in parts, of the samples around a cell: left and right.
struct Corners {
  uint16_t above[2], below[2];
};

/// SampleRows holds the cells around a panel row: between two rows of samples of even views, and
/// two rows of odd views, which lie half a step higher.
struct SampleRows {
  const uint32_t* key;     ///< [cache_view][column]: the surface that a cell shows, or 0
  const Corners* corners;  ///< [channel][cache_view][column]: valid if the cell shows a surface
  int plane;               ///< elements from one channel to the next
  float part[2];           ///< weight of the row below, for even and for odd views
};

/// Subpixels 3 i + channel of a row. Array lengths are rounded up to a multiple of kLanes.
struct Row {
  const float* x;
  const float* tan;
  const float* z;
  const int32_t* cut;     ///< -1 if nothing is visible
  const uint32_t* group;  ///< indexed by cut
  int count;
  float most_apart;  ///< largest difference between two views, in parts of a code
};

enum State : uint8_t { kFound = 0, kNothing = 1, kUnknown = 2 };

/// Results per subpixel; array lengths are rounded up to a multiple of kLanes.
struct Found {
  uint8_t* codes;   ///< valid in state kFound
  uint8_t* states;  ///< State
  // Positions of the points in the views on both sides, valid in the other states:
  int32_t* left;     ///< number of the left view
  float* of_right;   ///< weight of the right view, 0 to 1
  int32_t* cell[2];  ///< per view, index of a cell's left column in a row of samples, -1 outside
  float* part[2];    ///< per view, weight of the cell's right column
};

struct Kernel {
  void (*look_up)(const Grid&, const SampleRows&, const Row&, const Found&);
};

}  // namespace lenticule::render::lookup_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(lookup_kernel::Kernel, kLookupKernel)
}
