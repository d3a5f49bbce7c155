// SPDX-License-Identifier: Apache-2.0
// Method "full": one ray (or --samples rays) per subpixel, without reuse or interpolation.
#pragma once

#include <memory>

#include "render/methods/method.h"

namespace lenticule::render {

[[nodiscard]] std::unique_ptr<Method> make_method_full(const optics::OpticalModel& model,
                                                       const RenderOptions& options);

}  // namespace lenticule::render
