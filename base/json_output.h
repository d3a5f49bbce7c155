// SPDX-License-Identifier: Apache-2.0
// Prints results as JSON on standard output.
#pragma once

#include <nlohmann/json.hpp>

namespace lenticule {

/// Prints `value` to standard output. Commands build the JSON first and make their text output from
/// the same JSON, so that the two cannot differ.
void print_json(const nlohmann::json& value);

/// Returns `value`, or null for an infinite or undefined value, because JSON has no number for
/// either.
[[nodiscard]] nlohmann::json finite_or_null(double value);

}  // namespace lenticule
