// SPDX-License-Identifier: Apache-2.0
// WorstPlaces keeps the worst tiles of a method in a scenario as pictures for inspection.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/lenticule-bench/render/bench_error_eyes.h"
#include "frames/frame.h"
#include "frames/measures/worst_tiles.h"

namespace lenticule::bench {

/// Returns two rows of three magnified panes: reference, test, and their difference (colours of
/// frames::error_picture). The upper row shows the woven pixels of the tile, the lower row what an
/// eye sees there. The eye's pictures may have any size; they show the whole panel.
[[nodiscard]] frames::WovenFrame tile_sheet(const frames::FrameView& reference,
                                            const frames::FrameView& test,
                                            const frames::FrameView& seen_reference,
                                            const frames::FrameView& seen_test,
                                            const frames::Tile& tile);

/// Keeps the worst tiles of all added frames, at most one per place.
class WorstPlaces {
 public:
  void add(int frame, const frames::FrameView& reference, const frames::FrameView& test,
           const SeenPictures& seen_reference, const SeenPictures& seen_test);
  /// Writes FOLDER/STEM-1.png and so on, the worst first. Returns the list of files: [{"file",
  /// "frame", "x", "y", "width", "height", "mse", "eye"}]. Throws Error(Failed) if a file cannot be
  /// written.
  [[nodiscard]] nlohmann::json write(const std::string& folder, const std::string& stem) const;

 private:
  struct Place {
    frames::Tile tile;
    int frame;
    int eye;
    frames::WovenFrame sheet;
  };
  std::vector<Place> places_;  ///< worst first
};

}  // namespace lenticule::bench
