// SPDX-License-Identifier: Apache-2.0
// Method "adaptive": visibility is exact; shading is sampled and interpolated where it is smooth,
// and traced elsewhere.
#pragma once

#include <memory>

#include "render/methods/method.h"
#include "render/options/render_options.h"

namespace lenticule::render {

/// Makes the method. RenderOptions::tolerated_error is the tolerated error in code values. Throws
/// Error(Usage) if it is negative or not finite.
[[nodiscard]] std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                                           const RenderOptions& options);

/// Makes method adaptive prove a PSNR of each frame, in dB: sets RenderOptions::proven_rmse, and a
/// tolerated error of single subpixels that suits it. Throws Error(Usage) outside 20 ... 70 dB.
void promise_psnr(double db, RenderOptions& options);

}  // namespace lenticule::render
