// SPDX-License-Identifier: Apache-2.0
// Measures of pictures as slowly and plainly as their definitions: shares no code with frames/.
#pragma once

#include "frames/frame.h"

namespace lenticule::test {

/// Mean over one channel (0, 1, 2), or over all three (-1), of the squared difference.
[[nodiscard]] long double mse_by_definition(const frames::FrameView& a, const frames::FrameView& b,
                                            int channel);
/// 10 log10(255^2 / MSE); the pictures must differ.
[[nodiscard]] long double psnr_by_definition(const frames::FrameView& a, const frames::FrameView& b,
                                             int channel);

/// Mean SSIM of luma, each window on its own: weighted means, then weighted sums of squared
/// distances from them. Pictures of at least 11 x 11 pixels.
[[nodiscard]] long double ssim_by_definition(const frames::FrameView& a,
                                             const frames::FrameView& b);

/// LDR-FLIP of one pixel: every filter as one square of weights, borders as if their pixels went
/// on.
[[nodiscard]] long double flip_by_definition(const frames::FrameView& reference,
                                             const frames::FrameView& test, int i, int j,
                                             double pixels_per_degree);

}  // namespace lenticule::test
