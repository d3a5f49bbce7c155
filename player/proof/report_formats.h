// SPDX-License-Identifier: Apache-2.0
// Formats the report of the proof of play for people, spreadsheets and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "player/proof/proof_report.h"

namespace lenticule::player {

[[nodiscard]] nlohmann::ordered_json to_json(const ProofSummary& summary);
/// Returns a table with totals, and a line about each fact that the table does not show.
[[nodiscard]] std::string table_text(const ProofSummary& summary);
/// Returns lines of comma-separated values with a header, after RFC 4180. A text that a spreadsheet
/// would take for a formula begins with an apostrophe.
[[nodiscard]] std::string csv_text(const ProofSummary& summary);

}  // namespace lenticule::player
