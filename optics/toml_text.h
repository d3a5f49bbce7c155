// SPDX-License-Identifier: Apache-2.0
// Parses TOML for all our files. Include only from .cpp files that use toml++.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>
#include <string_view>

namespace lenticule::optics {

/// Returns the line, counted from 1, of the first character outside ASCII that is in neither a
/// string nor a comment; TOML does not allow such a character.
[[nodiscard]] std::optional<int> stray_letter_line(std::string_view text);

/// Parses TOML. Throws Error(Input) "source:line: cause". Keys are ASCII; strings and comments may
/// hold all characters that TOML allows.
[[nodiscard]] toml::table parse_toml(std::string_view text, const std::string& source);

}  // namespace lenticule::optics
