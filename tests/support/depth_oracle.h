// SPDX-License-Identifier: Apache-2.0
// One row of a picture and its depth, seen by one view, as slowly and plainly as possible: for
// every pixel, all pieces of the row are asked whether they cover it. Shares no code with
// frames/views_input/depth_views.cpp but the definition in its header.
#pragma once

#include <array>
#include <vector>

namespace lenticule::test {

struct DepthRow {
  std::vector<std::array<int, 3>> codes;
  std::vector<double> disparity;  ///< pixels between the outermost views, positive = near
};

using Colour = std::array<int, 3>;

/// Every colour that a right implementation may give pixel `k` of view `view` of `views`: several
/// where rounding decides between pieces. Codes are off by one at most.
[[nodiscard]] std::vector<Colour> depth_oracle(const DepthRow& row, int view, int views, int k);

}  // namespace lenticule::test
