// SPDX-License-Identifier: Apache-2.0
// Declares the flags for the layout of views in a source and for weaving, which play, weave and
// convert share.
#pragma once

#include "player/sources/content_flags.h"

namespace CLI {
class App;
}

namespace lenticule::player {

void declare_content_flags(CLI::App& app, ContentFlags& flags);
void declare_weaving_flags(CLI::App& app, WeavingFlags& flags);

}  // namespace lenticule::player
