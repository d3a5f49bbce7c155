// SPDX-License-Identifier: Apache-2.0
// SpotSum measures the sharpness of lenses: the light seen while only one place under each lens is
// lit, place after place.
#pragma once

#include "calib/calibration.h"
#include "calib/measure/fringe_phase.h"

namespace lenticule::calib {

class SpotSum {
 public:
  /// Takes `blocks`, the deviation of each part of the panel from the straight phase of the combs.
  ///
  /// Lifetime: `blocks` must outlive the sum.
  SpotSum(int bins, const BlockGrid& blocks, const LinearPhase& drawn, const optics::Panel& panel);

  /// Adds the picture of the comb at bin (b + 1/2) / bins - 1/2.
  void add(int bin, const GreyPicture& picture, const GreyPicture& dark,
           const std::vector<uint32_t>& pixels, int block_px);

  [[nodiscard]] LensSpot result() const;

 private:
  const BlockGrid& blocks_;
  std::vector<double> shifts_;  ///< shift of each block, bins
  std::vector<double> profile_;
};

}  // namespace lenticule::calib
