// SPDX-License-Identifier: Apache-2.0
// Structural similarity (SSIM) of two pictures, 1 for equal ones.
#pragma once

#include <optional>

#include "frames/frame.h"

namespace lenticule::frames {

/// Side of SSIM's window in pixels.
inline constexpr int kSimilarityWindow = 11;

/// Returns the mean SSIM of the luma 0.299 R + 0.587 G + 0.114 B of code values, as its authors
/// published it in 2004: Gaussian window of 11 x 11 pixels with sigma 1.5 that sums to 1, C1 =
/// (0.01 * 255)^2, C2 = (0.03 * 255)^2, over all positions of the window inside the picture.
/// Returns nothing for pictures smaller than the window. Throws Error(Input) if the sizes differ.
[[nodiscard]] std::optional<double> structural_similarity(const FrameView& reference,
                                                          const FrameView& test);

}  // namespace lenticule::frames
