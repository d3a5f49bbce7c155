// SPDX-License-Identifier: Apache-2.0
// ViewMap assigns each subpixel of a panel to a view. It is computed once and used to compare many
// frames.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/compare.h"
#include "frames/sequence/band_workers.h"

namespace lenticule::frames {

class ViewMap {
 public:
  /// Uses two bytes per subpixel. Throws Error(Usage) unless 1 <= views <= 4096.
  ViewMap(const optics::OpticalModel& model, int views, BandWorkers& workers);

  /// Returns one Difference per view, like compare_views(); their sum is the difference of the
  /// whole frames. Throws Error(Input) if a picture does not have the panel's size.
  [[nodiscard]] std::vector<Difference> compare(const FrameView& reference, const FrameView& test,
                                                BandWorkers& workers) const;

 private:
  FrameGeometry geometry_;
  int views_;
  std::vector<uint16_t> view_;
};

}  // namespace lenticule::frames
