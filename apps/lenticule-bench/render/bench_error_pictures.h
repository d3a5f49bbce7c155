// SPDX-License-Identifier: Apache-2.0
// The worst places of a method in a course, as pictures to be looked at.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/lenticule-bench/render/bench_error_eyes.h"
#include "frames/frame.h"
#include "frames/measures/worst_tiles.h"

namespace lenticule::player {

/// Two rows of three magnified panes: reference, test, and where they differ (colours of
/// frames::error_picture); above the woven pixels of the tile, below what an eye sees there. The
/// eye's pictures may be of any size; they show the whole panel.
[[nodiscard]] frames::WovenFrame tile_sheet(const frames::FrameView& reference,
                                            const frames::FrameView& test,
                                            const frames::FrameView& seen_reference,
                                            const frames::FrameView& seen_test,
                                            const frames::Tile& tile);

/// Keeps the worst tiles of all frames that it is shown, no two at one place.
class WorstPlaces {
 public:
  void add(int frame, const frames::FrameView& reference, const frames::FrameView& test,
           const SeenPictures& seen_reference, const SeenPictures& seen_test);
  /// FOLDER/STEM-1.png and on, the worst first; what was written: [{"file", "frame", "x", "y",
  /// "width", "height", "mse", "eye"}]. Throws Error(Failed) if a file cannot be written.
  [[nodiscard]] nlohmann::json write(const std::string& folder, const std::string& stem) const;

 private:
  struct Place {
    frames::Tile tile;
    int frame;
    int eye;
    frames::WovenFrame sheet;
  };
  std::vector<Place> places_;  ///< the worst first
};

}  // namespace lenticule::player
