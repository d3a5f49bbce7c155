// SPDX-License-Identifier: Apache-2.0
// The inner loop of method adaptive, compiled once per instruction set: what the subpixels of a row
// see, found in the key pictures. Plain data only.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/shading/code_parts.h"

namespace lenticule::render::lookup_kernel {

inline constexpr int kLanes = 16;
/// Samples are code values in parts of a code.
using render::kCodeParts;

/// The key pictures of one rig; lengths in millimetres, or tangents where rays are parallel. The
/// samples of odd pictures lie half a column to the left of those of even ones.
struct Grid {
  float x_first;
  float columns_per_mm;
  float eye_first;
  float eye_step;
  float pictures_per_eye;
  float near;       ///< part of the way between pictures in which one is enough for shiny things
  float inverse_z;  ///< 1 / Z, 0 where rays are parallel
  float distance;   ///< Z, 0 where rays are parallel
  int pictures;
  int columns;
  int stride;
};

/// Set in the key of a cell whose corners show one surface, but not alike.
inline constexpr uint32_t kUneven = 0x80000000U;

/// The rows of samples around a row of the panel: of even pictures, and of odd ones, which lie half
/// a step higher.
struct SampleRows {
  const uint32_t* key;  ///< [picture][column]: the surface that a cell's corners all show, or 0
  /// All samples of the frame: [row][channel][picture][column].
  const uint16_t* values;
  int plane;      ///< elements from one channel to the next
  int row[2];     ///< index of the row of samples above
  float part[2];  ///< of the way from there to the row below
};

/// Subpixels 3 i + channel of a row. Arrays have room for a multiple of kLanes.
struct Row {
  const float* x;
  const float* tan;
  const float* z;
  const int32_t* cut;     ///< -1 where nothing is seen
  const uint32_t* group;  ///< by cut
  int count;
  float most_apart;  ///< parts of a code that two pictures may differ
};

enum State : uint8_t { kFound = 0, kNothing = 1, kUnknown = 2 };

/// Of each subpixel; arrays have room for a multiple of kLanes.
struct Found {
  uint8_t* codes;   ///< of those that were found
  uint8_t* states;  ///< State
  // Where the points of the others lie in the pictures on both sides of their view:
  int32_t* left;     ///< number of the one to the left
  float* of_right;   ///< weight of the other, 0 to 1
  int32_t* cell[2];  ///< index of a cell's left column in a row of samples, -1 outside; of both
  float* part[2];    ///< of the way to its right column
};

struct Kernel {
  void (*look_up)(const Grid&, const SampleRows&, const Row&, const Found&);
};

}  // namespace lenticule::render::lookup_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(lookup_kernel::Kernel, kLookupKernel)
}
