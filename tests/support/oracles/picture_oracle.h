// SPDX-License-Identifier: Apache-2.0
// Measures differences of pictures by the plain definitions. It shares no code with frames/.
#pragma once

#include "frames/frame.h"

namespace lenticule::test {

/// Returns the mean squared difference over one channel (0, 1, 2), or over all three (-1).
[[nodiscard]] long double mse_by_definition(const frames::FrameView& a, const frames::FrameView& b,
                                            int channel);
/// Returns 10 log10(255^2 / MSE); the pictures must differ.
[[nodiscard]] long double psnr_by_definition(const frames::FrameView& a, const frames::FrameView& b,
                                             int channel);

/// Returns the mean SSIM of luma, each window on its own: weighted means, then weighted sums of
/// squared distances from them. The pictures need at least 11 x 11 pixels.
[[nodiscard]] long double ssim_by_definition(const frames::FrameView& a,
                                             const frames::FrameView& b);

/// Returns LDR-FLIP of one pixel: every filter as one square of weights; border pixels are repeated
/// outward.
[[nodiscard]] long double flip_by_definition(const frames::FrameView& reference,
                                             const frames::FrameView& test, int i, int j,
                                             double pixels_per_degree);

}  // namespace lenticule::test
