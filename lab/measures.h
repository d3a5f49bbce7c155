// SPDX-License-Identifier: Apache-2.0
// Measures of frames of an approximate method beside exact ones: flicker, and the places of the
// largest differences.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/compare.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"

namespace lenticule::lab {

using frames::FrameGeometry;
using frames::FrameView;

struct Flicker {
  double mean =
      0.0;  ///< mean of |e(t) - e(t - 1)| over all samples, e = test - reference, code values
  int largest = 0;
};

/// FlickerMeter measures flicker, the change of the error from one picture to the next: a steady
/// error looks like part of the picture, a changing one is noticed. Receives the pictures of one
/// sequence in order. Uses two bytes per sample.
class FlickerMeter {
 public:
  /// Returns the change since the previous call; zeros for the first call. Throws Error(Input) if
  /// the sizes differ, also from the previous sizes.
  Flicker add(const FrameView& reference, const FrameView& test);

 private:
  FrameGeometry geometry_;
  std::vector<int16_t> before_;
};

/// A place of a picture with a large error, for inspection.
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
/// MSE. The candidates begin at multiples of half a side or end at the picture's border; among
/// those of equal MSE the upper, then the left one comes first. Tiles are clipped to a picture
/// smaller than a tile. Tiles without a difference are omitted. Throws Error(Input) if the sizes
/// differ, Error(Usage) for a side below 1.
[[nodiscard]] std::vector<Tile> worst_tiles(const FrameView& reference, const FrameView& test,
                                            int side, int count);

}  // namespace lenticule::lab
