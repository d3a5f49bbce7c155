// SPDX-License-Identifier: Apache-2.0
// Answers requests for the state of player and machine: state, events, health, report, metrics.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "apps/lenticule-web/api/route.h"

namespace lenticule::web {

[[nodiscard]] std::span<const Route> state_routes();

/// Returns the player's state, the rights of the sender and the values of the machine.
[[nodiscard]] nlohmann::ordered_json state_json(WebSite& site, const Request& request);

}  // namespace lenticule::web
