// SPDX-License-Identifier: Apache-2.0
// Metrics in the text format of Prometheus, and the health report of a player.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/lenticule-web/link/player_state.h"

namespace lenticule::web {

/// Returns the metrics of a player; without one only lenticule_up 0.
[[nodiscard]] std::string metrics_text(const PlayerState& player);
/// Returns {"connected", "verdict", "sentences", "exactness", "history", "faults", "machine"}.
/// `sentences` say in plain words what is not as it should be.
[[nodiscard]] nlohmann::ordered_json health_json(const PlayerState& player);
/// Returns temperatures and clock rates of the machine, as far as the kernel states them.
[[nodiscard]] nlohmann::ordered_json machine_json(const std::filesystem::path& sys = "/sys");

}  // namespace lenticule::web
