// SPDX-License-Identifier: Apache-2.0
// The methods that reuse points: of neighbouring micro-images, of the frame before, or both.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "render/methods/method.h"

namespace lenticule::render {

enum class Reuse { LensView, Interpolate, Temporal, Hybrid };

[[nodiscard]] std::optional<Reuse> reuse_named(std::string_view name);

/// The model must outlive it. options.samples is 1.
[[nodiscard]] std::unique_ptr<Method> make_method_reuse(Reuse reuse,
                                                        const optics::OpticalModel& model,
                                                        const RenderOptions& options);

}  // namespace lenticule::render
