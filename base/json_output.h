// SPDX-License-Identifier: Apache-2.0
// Prints results as JSON on standard output.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/print.h"
#include "base/text.h"

namespace lenticule {

/// Prints `value` to standard output. Commands build the JSON first and make their text output from
/// the same JSON, so that the two cannot differ.
inline void print_json(const nlohmann::json& value) {
  print_out("{}\n", Verbatim{json_text(value, 2)});
}

/// Prints a result as JSON, or for people as `print_text` makes it from the JSON.
template <class PrintText>
void print_result(const nlohmann::json& value, bool as_json, const PrintText& print_text) {
  as_json ? print_json(value) : print_text(value);
}

/// Returns `value`, or null for an infinite or undefined value, because JSON has no number for
/// either.
[[nodiscard]] inline nlohmann::json finite_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

}  // namespace lenticule
