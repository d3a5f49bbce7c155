// SPDX-License-Identifier: Apache-2.0
// Writes values of our TOML files.
#pragma once

#include <string>
#include <string_view>

namespace lenticule::optics {

/// Returns a floating-point number with the fewest digits that read back as the same bits.
[[nodiscard]] std::string toml_number(double value);

/// Returns a string in quotes.
[[nodiscard]] std::string toml_string(std::string_view text);

}  // namespace lenticule::optics
