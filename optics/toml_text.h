// SPDX-License-Identifier: Apache-2.0
// TOML as all our files are read. Only for the .cpp files that know toml++.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>
#include <string_view>

namespace lenticule::optics {

/// The line, counted from 1, of the first letter outside ASCII that is neither in a text nor in a
/// comment, where TOML has no use for one.
[[nodiscard]] std::optional<int> stray_letter_line(std::string_view text);

/// Throws Error(Input) "source:line: cause". Keys are ASCII; texts and comments may be anything
/// that TOML allows.
[[nodiscard]] toml::table parse_toml(std::string_view text, const std::string& source);

}  // namespace lenticule::optics
