// SPDX-License-Identifier: Apache-2.0
// Answers requests that change the picture on the panel: play, pause, seek, interrupt, cue, speed,
// power.
#pragma once

#include <span>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> playing_routes();

}  // namespace lenticule::web
