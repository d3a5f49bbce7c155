// SPDX-License-Identifier: Apache-2.0
// Method "adaptive": visibility is exact; shading is sampled and interpolated where it is smooth,
// and traced elsewhere.
#pragma once

#include <memory>

#include "render/methods/method.h"

namespace lenticule::render {

/// Makes the method. RenderOptions::tolerated_error is the tolerated error in code values. Throws
/// Error(Usage) if it is negative or not finite.
[[nodiscard]] std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                                           const RenderOptions& options);

}  // namespace lenticule::render
