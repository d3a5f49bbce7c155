// SPDX-License-Identifier: Apache-2.0
// Which lens a ray of a tile passes, told from where it passes the glass.
#pragma once

#include <array>
#include <vector>

#include "optics/model.h"
#include "render/methods/reuse/reprojection_kernel.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// Immutable after construction, safe from any thread.
class LensNumbers {
 public:
  /// Both must outlive it.
  LensNumbers(const optics::OpticalModel& model, const TilePlan& plan);

  struct Line {
    double offset = 0.0;
    double per_mm = 0.0;
  };
  /// lens = offset + per_mm x, of apex lines near x in one row.
  [[nodiscard]] Line line_at(int row, int channel, double x_mm) const;

  /// For the columns c, c + 3, ... of a tile, by c mod 3: their lanes' channels repeat.
  using Maps = std::array<reprojection::LensMap, 3>;
  void expand(const Tile& tile, Maps& maps) const;

 private:
  [[nodiscard]] Line line(int row, int channel, int left_px, int right_px) const;

  const optics::OpticalModel& model_;
  const TilePlan& plan_;
  bool straight_;            ///< lenses are equally wide everywhere
  std::vector<Line> lines_;  ///< [row][channel], where straight_
};

}  // namespace lenticule::render
