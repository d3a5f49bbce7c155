// SPDX-License-Identifier: Apache-2.0
// The methods that reuse points: from neighbouring micro-images, from the previous frame, or both.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "render/methods/method.h"

namespace lenticule::render {

enum class Reuse { LensView, Interpolate, Temporal, Hybrid };

[[nodiscard]] std::optional<Reuse> reuse_named(std::string_view name);

/// Makes a method. Requires options.samples == 1. Lifetime: the model must outlive the method.
[[nodiscard]] std::unique_ptr<Method> make_method_reuse(Reuse reuse,
                                                        const optics::OpticalModel& model,
                                                        const RenderOptions& options);

}  // namespace lenticule::render
