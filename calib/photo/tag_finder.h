// SPDX-License-Identifier: Apache-2.0
// Finds the chart's tags in a photograph.
#pragma once

#include <array>
#include <vector>

#include "optics/vec.h"

namespace lenticule::calib {

/// Light of one channel, rows from the top.
struct PhotoLight {
  int width = 0;
  int height = 0;
  std::vector<float> light;
};

struct TagSighting {
  int id = 0;
  /// In the order of ChartTag::corners_px, picture pixels; (0, 0) is the corner of the first pixel.
  std::array<Vec2, 4> corners_px;
};

/// All tags of the family, each once: the clearest of several. Sorted by id. Where fewer than
/// `wanted` are found, softer copies of the picture are searched, too. Light that is not finite
/// counts as black. Any thread, uses one.
[[nodiscard]] std::vector<TagSighting> find_tags(const PhotoLight& picture, size_t wanted);

}  // namespace lenticule::calib
