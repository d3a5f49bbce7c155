// SPDX-License-Identifier: Apache-2.0
// Reads and writes rig files: TOML that people edit. docs/panel/optics.md has the list of keys.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

/// Parses and validates a rig. Every failure (syntax, unknown key, wrong type, value out of range)
/// is an Error(Input) that starts with "source:line:". The error for an unknown key names the most
/// similar known key.
[[nodiscard]] Rig parse_rig(std::string_view toml, const std::string& source);

/// Parses a file as parse_rig() does. Throws Error(Input) also for a file that cannot be read or is
/// larger than 16 MiB.
[[nodiscard]] Rig load_rig(const std::filesystem::path& file);

/// Returns the file's text; parse_rig() restores the same rig from the text, bit for bit.
[[nodiscard]] std::string rig_to_toml(const Rig& rig);

/// Writes the rig atomically (temporary name, then rename). Throws Error(Failed).
void save_rig(const Rig& rig, const std::filesystem::path& file);

}  // namespace lenticule::optics
