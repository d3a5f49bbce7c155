// SPDX-License-Identifier: Apache-2.0
// Reference implementation of one row of a depth view, slow and simple: every pixel is tested
// against all pieces of the row. It shares only the definition in the header with
// frames/views_input/depth_views.cpp.
#pragma once

#include <array>
#include <vector>

namespace lenticule::test {

struct DepthRow {
  std::vector<std::array<int, 3>> codes;
  std::vector<double> disparity;  ///< pixels between the outermost views, positive = near
};

using Colour = std::array<int, 3>;

/// Returns every colour that a correct implementation may give pixel `k` of view `view` of `views`:
/// several if rounding decides between pieces. Codes may differ by one.
[[nodiscard]] std::vector<Colour> depth_oracle(const DepthRow& row, int view, int views, int k);

}  // namespace lenticule::test
