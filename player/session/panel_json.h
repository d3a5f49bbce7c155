// SPDX-License-Identifier: Apache-2.0
// Converts cards, panels and exactness reports to JSON for `panels`, `doctor` and the player's
// statistics.
#pragma once

#include <nlohmann/json.hpp>

#include "display/kms/color/exactness_report.h"
#include "display/kms/inspect.h"
#include "display/kms/scanout/kms_display.h"

namespace lenticule::player {

[[nodiscard]] nlohmann::json to_json(const display::CardInfo& card);
[[nodiscard]] nlohmann::json to_json(const display::PanelInfo& panel);
[[nodiscard]] nlohmann::json to_json(const display::ExactnessReport& report);
[[nodiscard]] nlohmann::json to_json(const display::Diagnosis& diagnosis);
[[nodiscard]] nlohmann::json to_json(const display::TileGroup& group);
[[nodiscard]] nlohmann::json to_json(const display::KmsStatistics& statistics);

}  // namespace lenticule::player
