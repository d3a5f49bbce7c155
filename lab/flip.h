// SPDX-License-Identifier: Apache-2.0
// FLIP measures how strongly a viewer notices a difference when two pictures alternate: 0 for an
// invisible difference, at most 1.
#pragma once

#include <array>
#include <vector>

#include "frames/frame.h"

namespace lenticule::lab {

/// Default of FLIP's authors: a 4K monitor of 0.7 m width, seen from 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.0206432765823;

/// FlipPicture holds one picture in the form that FLIP compares: its colours as blurred by the eye,
/// in the authors' adjusted L*a*b*, and its edges and points. Computed once per picture, for any
/// number of comparisons.
class FlipPicture {
 public:
  /// Takes 8-bit sRGB codes. Throws Error(Usage) unless 1 <= pixels_per_degree <= 1000.
  FlipPicture(const frames::FrameView& picture, double pixels_per_degree);

 private:
  friend std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test);

  frames::FrameGeometry geometry_;
  double pixels_per_degree_;
  std::array<std::vector<float>, 3> colour_;
  std::vector<float> edges_;
  std::vector<float> points_;
};

/// Returns the LDR-FLIP of each pixel, row by row, after Andersson, Nilsson, Akenine-Moeller,
/// Oskarsson, Astrom and Fairchild, "FLIP: A Difference Evaluator for Alternating Images", 2020, in
/// single precision. Beyond the border of a picture its border pixels are repeated. Symmetric.
/// Throws Error(Input) if the sizes differ, and Error(Usage) if the pixels per degree differ.
[[nodiscard]] std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test);

struct FlipFigures {
  double mean = 0.0;
  double percentile_99 = 0.0;  ///< the smallest value that 99 % of the pixels do not exceed
};
/// Returns zeros for an empty map.
[[nodiscard]] FlipFigures flip_figures(std::vector<float> map);

}  // namespace lenticule::lab
