// SPDX-License-Identifier: Apache-2.0
// Which view each subpixel of a panel belongs to, worked out once, for comparing many frames.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/compare.h"
#include "frames/sequence/band_workers.h"

namespace lenticule::frames {

class ViewMap {
 public:
  /// Two bytes a subpixel. Throws Error(Usage) unless 1 <= views <= 4096.
  ViewMap(const optics::OpticalModel& model, int views, BandWorkers& workers);

  /// As compare_views: one Difference per view; what all of them add up to is the frame's. Throws
  /// Error(Input) if a picture is not of the panel's size.
  [[nodiscard]] std::vector<Difference> compare(const FrameView& reference, const FrameView& test,
                                                BandWorkers& workers) const;

 private:
  FrameGeometry geometry_;
  int views_;
  std::vector<uint16_t> view_;
};

}  // namespace lenticule::frames
