// SPDX-License-Identifier: Apache-2.0
#include "base/json_output.h"

#include <cmath>

#include "base/print.h"
#include "base/text.h"

namespace lenticule {

void print_json(const nlohmann::json& value) {
  print_out("{}\n", Verbatim{json_text(value, 2)});
}

nlohmann::json finite_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

}  // namespace lenticule
