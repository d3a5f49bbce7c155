// SPDX-License-Identifier: Apache-2.0
// The places of a picture that are furthest off, to be looked at.
#pragma once

#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

struct Tile {
  int x = 0;  ///< of its upper left pixel
  int y = 0;
  int width = 0;
  int height = 0;
  double mse = 0.0;  ///< over its pixels and channels, in squared code values

  [[nodiscard]] bool overlaps(const Tile& other) const {
    return x < other.x + other.width && other.x < x + width && y < other.y + other.height &&
           other.y < y + height;
  }
};

/// Up to `count` tiles of side x side pixels that do not overlap, the furthest off first: each the
/// one with the largest MSE (of equals the upper, then the left one) among those that begin at
/// multiples of eight or end with the picture and overlap none before. Where the picture is smaller
/// than a tile, tiles are as large as it is. Tiles in which nothing differs are left out. Throws
/// Error(Input) if the sizes differ, Error(Usage) for a side below 1.
[[nodiscard]] std::vector<Tile> worst_tiles(const FrameView& reference, const FrameView& test,
                                            int side, int count);

}  // namespace lenticule::frames
