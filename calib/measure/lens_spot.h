// SPDX-License-Identifier: Apache-2.0
// How sharply lenses show one place under them: light seen while only one place of each lens is
// lit, place after place.
#pragma once

#include "calib/calibration.h"
#include "calib/measure/fringe_phase.h"

namespace lenticule::calib {

class SpotSum {
 public:
  /// `blocks` say how far each part of the panel is off the straight phase that the combs are drawn
  /// with. Borrowed.
  SpotSum(int bins, const BlockGrid& blocks, const LinearPhase& drawn, const optics::Panel& panel);

  /// The picture of the comb at bin (b + 1/2) / bins - 1/2.
  void add(int bin, const GreyPicture& picture, const GreyPicture& dark,
           const std::vector<uint32_t>& pixels, int block_px);

  [[nodiscard]] LensSpot result() const;

 private:
  const BlockGrid& blocks_;
  std::vector<double> shifts_;  ///< of each block, bins
  std::vector<double> profile_;
};

}  // namespace lenticule::calib
