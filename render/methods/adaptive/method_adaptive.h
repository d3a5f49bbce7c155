// SPDX-License-Identifier: Apache-2.0
// Method "adaptive": visibility is exact, shading is sampled where it is smooth and traced where it
// is not.
#pragma once

#include <memory>

#include "render/methods/method.h"

namespace lenticule::render {

/// RenderOptions::tolerated_error says how far, in code values. Throws Error(Usage) for an error
/// that is negative or not finite.
[[nodiscard]] std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                                           const RenderOptions& options);

}  // namespace lenticule::render
