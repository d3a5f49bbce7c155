// SPDX-License-Identifier: Apache-2.0
// Flags of commands that render with lamps that have a size and with light from all around.
#pragma once

#include "render/options/soft_light.h"

namespace CLI {
class App;
}

namespace lenticule::player {

/// `soft` must outlive the parser.
void declare_soft_light_flags(CLI::App& app, render::SoftLight& soft);

}  // namespace lenticule::player
