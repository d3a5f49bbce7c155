// SPDX-License-Identifier: Apache-2.0
// Finds the chart's tags in a photograph.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "optics/vec.h"

namespace lenticule::calib {

/// PhotoLight is the light of a photograph, rows from the top.
struct PhotoLight {
  int width = 0;
  int height = 0;
  std::vector<float> light;  ///< mean of the channels
  /// Clipped part of the values that each pixel averages, in 255ths; empty: nothing was clipped.
  std::vector<uint8_t> clipped = {};
  std::vector<std::array<float, 3>> colours = {};  ///< red, green, blue; empty for grey pictures
};

struct TagSighting {
  int id = 0;
  /// Order of ChartTag::corners_px, picture pixels; (0, 0) is the corner of the first pixel.
  std::array<Vec2, 4> corners_px;
};

/// Returns all tags of the family, sorted by id, each once (the clearest sighting), with corners
/// that all edges of the tag determine (tag_alignment.h). If fewer than `wanted` are found, also
/// searches blurred copies of the picture. Light that is not finite counts as black.
///
/// Thread safety: any thread; starts no threads.
[[nodiscard]] std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted);

}  // namespace lenticule::calib
