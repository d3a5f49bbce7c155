// SPDX-License-Identifier: Apache-2.0
// Results as JSON on standard output.
#pragma once

#include <nlohmann/json.hpp>

namespace lenticule {

/// Prints results to standard output. The JSON is built first; the text is made from it, so that
/// the two cannot disagree.
void print_json(const nlohmann::json& value);

/// JSON has no infinity; null stands for it.
[[nodiscard]] nlohmann::json finite_or_null(double value);

}  // namespace lenticule
