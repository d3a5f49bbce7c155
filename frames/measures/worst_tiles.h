// SPDX-License-Identifier: Apache-2.0
// Finds the tiles of a picture with the largest error, for inspection.
#pragma once

#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

struct Tile {
  int x = 0;  ///< x of the upper left pixel
  int y = 0;
  int width = 0;
  int height = 0;
  double mse = 0.0;  ///< mean over its pixels and channels, in squared code values

  [[nodiscard]] bool overlaps(const Tile& other) const {
    return x < other.x + other.width && other.x < x + width && y < other.y + other.height &&
           other.y < y + height;
  }
};

/// Returns up to `count` tiles of side x side pixels that do not overlap, in descending order of
/// MSE. The candidates begin at multiples of eight or end at the picture's border; among candidates
/// of equal MSE the upper, then the left one comes first. Tiles are clipped to a picture smaller
/// than a tile. Tiles without a difference are omitted. Throws Error(Input) if the sizes differ,
/// Error(Usage) for a side below 1.
[[nodiscard]] std::vector<Tile> worst_tiles(const FrameView& reference, const FrameView& test,
                                            int side, int count);

}  // namespace lenticule::frames
