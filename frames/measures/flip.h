// SPDX-License-Identifier: Apache-2.0
// FLIP: how strongly a difference is noticed when two pictures are flipped back and forth, 0 where
// nothing is seen, 1 at most.
#pragma once

#include <array>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

/// What FLIP's authors assume unless told: a 4K monitor of 0.7 m, seen from 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.0206432765823;

/// One picture as FLIP compares it: its colours as the eye blurs them, in the authors' adjusted
/// L*a*b*, and its edges and points. Made once for each picture, however often it is compared.
class FlipPicture {
 public:
  /// 8-bit sRGB codes. Throws Error(Usage) unless 1 <= pixels_per_degree <= 1000.
  FlipPicture(const FrameView& picture, double pixels_per_degree);

 private:
  friend std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test);

  FrameGeometry geometry_;
  double pixels_per_degree_;
  std::array<std::vector<float>, 3> colour_;
  std::vector<float> edges_;
  std::vector<float> points_;
};

/// LDR-FLIP of each pixel, row by row, after Andersson, Nilsson, Akenine-Moeller, Oskarsson,
/// Astrom and Fairchild, "FLIP: A Difference Evaluator for Alternating Images", 2020, in single
/// precision. Pictures end as if their border pixels went on. Symmetric. Throws Error(Input) if the
/// sizes, and Error(Usage) if the pixels per degree differ.
[[nodiscard]] std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test);

struct FlipFigures {
  double mean = 0.0;
  double percentile_99 = 0.0;  ///< the smallest value that 99 % of the pixels do not exceed
};
/// Zeros for an empty map.
[[nodiscard]] FlipFigures flip_figures(std::vector<float> map);

}  // namespace lenticule::frames
