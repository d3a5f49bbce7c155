// SPDX-License-Identifier: Apache-2.0
// Method "full": one ray (or --samples rays) per subpixel, without reuse or interpolation.
#pragma once

#include <memory>

#include "render/methods/full_tiles.h"
#include "render/methods/method.h"

namespace lenticule::render {

[[nodiscard]] std::unique_ptr<Method> make_method_full(const optics::OpticalModel& model,
                                                       const RenderOptions& options);
/// Makes the method with tiles that were made for the same rig and options.
[[nodiscard]] std::unique_ptr<Method> make_method_full(std::shared_ptr<const FullTiles> tiles,
                                                       const optics::Rig& rig,
                                                       const RenderOptions& options);

}  // namespace lenticule::render
