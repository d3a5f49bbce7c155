// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/seen_pixels.h"

#include <algorithm>
#include <cmath>

namespace lenticule::calib {

std::vector<Sighting> mean_sightings(const DecodedPixels& decoded, const PictureBlocks& blocks) {
  const auto& [pixels, x, y] = decoded;
  const auto& [width, height, side_px] = blocks;
  const int columns = (width + side_px - 1) / side_px;
  const int rows = (height + side_px - 1) / side_px;
  std::vector<std::vector<Sighting>> members(static_cast<size_t>(columns) *
                                             static_cast<size_t>(rows));
  for (size_t n = 0; n < pixels.size(); ++n) {
    if (std::isnan(x[n]) || std::isnan(y[n])) continue;
    const int i = static_cast<int>(pixels[n]) % width;
    const int j = static_cast<int>(pixels[n]) / width;
    members[static_cast<size_t>(j / side_px) * static_cast<size_t>(columns) +
            static_cast<size_t>(i / side_px)]
        .push_back({.camera_px = {i + 0.5, j + 0.5}, .panel_px = {x[n], y[n]}});
  }
  std::vector<Sighting> sightings;
  for (const std::vector<Sighting>& block : members) {
    if (static_cast<int>(block.size()) < side_px * side_px / 3) continue;
    Sighting mean{.camera_px = {}, .panel_px = {}};
    for (const Sighting& s : block) {
      mean.camera_px = mean.camera_px + s.camera_px;
      mean.panel_px = mean.panel_px + s.panel_px;
    }
    const double share = 1.0 / static_cast<double>(block.size());
    mean.camera_px = mean.camera_px * share;
    mean.panel_px = mean.panel_px * share;
    sightings.push_back(mean);
  }
  return sightings;
}

SeenPixels pixels_near_map(const DecodedPixels& decoded, const PictureBlocks& blocks,
                           const PanelMap& map, const optics::Panel& panel, double lens_px,
                           const MarkCells& marks) {
  const auto& [pixels, x, y] = decoded;
  // A pixel sees, through its lens, up to half a lens beside the smooth map, and more because of
  // noise.
  const double limit = std::max(3.0, 1.2 * lens_px) + 6.0 * map.typical_error_px();
  SeenPixels kept;
  for (size_t n = 0; n < pixels.size(); ++n) {
    const Vec2 camera{static_cast<int>(pixels[n]) % blocks.width + 0.5,
                      static_cast<int>(pixels[n]) / blocks.width + 0.5};
    const Vec2 p = map.at(camera);
    const bool near = std::abs(p.x - x[n]) < limit && std::abs(p.y - y[n]) < limit;
    const bool inside = p.x > 0.0 && p.y > 0.0 && p.x < panel.width_px && p.y < panel.height_px;
    if (!near || !inside || marks.covers(p.x, p.y)) continue;
    kept.decoded.pixels.push_back(pixels[n]);
    kept.decoded.x.push_back(x[n]);
    kept.decoded.y.push_back(y[n]);
    kept.panel_points.push_back(p);
  }
  return kept;
}

}  // namespace lenticule::calib
