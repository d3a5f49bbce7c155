// SPDX-License-Identifier: Apache-2.0
// PatternManifest is a file beside written patterns that records their rig.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "optics/rig.h"

namespace lenticule::calib {

/// Name of the manifest in the patterns' own folder, or copied beside their photographs.
inline constexpr const char* kPatternManifest = "patterns.json";

struct PatternManifest {
  std::string rig_name;
  std::string fingerprint;
  double pitch_subpx = 0.0;
  double slant = 0.0;
  int patterns = 0;
};

[[nodiscard]] PatternManifest manifest_of(const optics::Rig& rig, size_t patterns);

/// Writes the manifest into the folder, which must exist. Throws Error(Failed).
void write_manifest(const PatternManifest& manifest, const std::filesystem::path& folder);

/// Reads a folder's manifest; returns nothing if there is none. Throws Error(Input) for an invalid
/// manifest.
[[nodiscard]] std::optional<PatternManifest> read_manifest(const std::filesystem::path& folder);

/// Throws Error(Input) that names both rigs unless the manifest belongs to the rig.
void check_manifest(const PatternManifest& manifest, const optics::Rig& rig,
                    const std::filesystem::path& folder);

}  // namespace lenticule::calib
