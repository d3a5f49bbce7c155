// SPDX-License-Identifier: Apache-2.0
// Rig files: TOML that people edit. docs/optics.md has the list of keys.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

/// Parses and validates. Every failure (syntax, unknown key, wrong type, absurd value) is an
/// Error(Input) that starts with "source:line:". Unknown keys name the nearest known one.
[[nodiscard]] Rig parse_rig(std::string_view toml, const std::string& source);

/// As parse_rig; a file that cannot be read or is larger than 16 MiB is an Error(Input) too.
[[nodiscard]] Rig load_rig(const std::filesystem::path& file);

/// The file's text; parse_rig gives the same rig back, bit for bit.
[[nodiscard]] std::string rig_to_toml(const Rig& rig);

/// Writes to a temporary name beside `file` and renames. Throws Error(Failed).
void save_rig(const Rig& rig, const std::filesystem::path& file);

}  // namespace lenticule::optics
