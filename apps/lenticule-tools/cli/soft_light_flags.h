// SPDX-License-Identifier: Apache-2.0
// Declares flags for rendering with area lights and with light from the environment.
#pragma once

#include "render/options/render_options.h"

namespace CLI {
class App;
}

namespace lenticule::tools {

/// Lifetime: `soft` must outlive the parser.
void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft);

}  // namespace lenticule::tools
