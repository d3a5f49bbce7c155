// SPDX-License-Identifier: Apache-2.0
// Averages the decoded panel points of camera pixels over blocks, and selects the pixels whose
// points agree with the smooth map.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/measure/panel_map.h"
#include "calib/measure/pattern.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// PictureBlocks divides a camera's picture into squares.
struct PictureBlocks {
  int width = 0;  ///< size of the picture
  int height = 0;
  int side_px = 16;
};

/// DecodedPixels holds camera pixels, as indices into their picture, and the decoded panel point of
/// each; NaN where it could not be decoded.
struct DecodedPixels {
  std::vector<uint32_t> pixels;
  std::vector<float> x;
  std::vector<float> y;
};

/// Returns the means over the blocks of which at least a third was decoded.
[[nodiscard]] std::vector<Sighting> mean_sightings(const DecodedPixels& decoded,
                                                   const PictureBlocks& blocks);

/// SeenPixels holds pixels that see the panel, and their points on the smooth map.
struct SeenPixels {
  DecodedPixels decoded;
  std::vector<Vec2> panel_points;
};

/// Returns the pixels near their points on the map and inside the panel, without those that see the
/// marks. `lens_px` is the width of a lens in panel pixels.
[[nodiscard]] SeenPixels pixels_near_map(const DecodedPixels& decoded, const PictureBlocks& blocks,
                                         const PanelMap& map, const optics::Panel& panel,
                                         double lens_px, const MarkCells& marks);

}  // namespace lenticule::calib
