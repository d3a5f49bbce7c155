// SPDX-License-Identifier: Apache-2.0
// LensNumbers computes the lens that a ray of a tile passes from the ray's point on the panel.
#pragma once

#include <array>
#include <vector>

#include "optics/model.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// LensNumbers maps rays of one rig to lens numbers. Thread safety: immutable after construction,
/// usable from any thread.
class LensNumbers {
 public:
  /// Lifetime: `model` and `plan` must outlive the object.
  LensNumbers(const optics::OpticalModel& model, const TilePlan& plan);

  struct Line {
    double offset = 0.0;
    double per_mm = 0.0;
  };
  /// Returns the line lens = offset + per_mm x, valid for apex lines near x in one row.
  [[nodiscard]] Line line_at(int row, int channel, double x_mm) const;

  /// Lens maps for columns c, c + 3, ... of a tile, by c mod 3, since the channels of the lanes
  /// repeat.
  using Maps = std::array<reprojection::LensMap, 3>;
  void expand(const Tile& tile, Maps& maps) const;

 private:
  [[nodiscard]] Line line(int row, int channel, int left_px, int right_px) const;

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  bool straight_;            ///< all lenses have the same width
  std::vector<Line> lines_;  ///< [row][channel], if straight_
};

}  // namespace lenticule::render
