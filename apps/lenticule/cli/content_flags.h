// SPDX-License-Identifier: Apache-2.0
// Declares the flags that say how views lie in a source and how they are woven; play, weave and
// convert share them.
#pragma once

#include "player/sources/content_flags.h"

namespace CLI {
class App;
}

namespace lenticule::player {

void declare_content_flags(CLI::App& app, ContentFlags& flags);
void declare_weaving_flags(CLI::App& app, WeavingFlags& flags);

}  // namespace lenticule::player
