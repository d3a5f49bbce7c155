// SPDX-License-Identifier: Apache-2.0
// write_photo_pack packs photographs of a calibration so that others can repeat it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "optics/rig.h"

namespace lenticule::tools {

/// PhotoPack is what the archive holds. The report becomes report.json.
struct PhotoPack {
  std::vector<std::filesystem::path> sources;  ///< photographs, or folders of photographs
  optics::Rig start;                           ///< becomes start.toml
  std::optional<double> focal_px;
  std::vector<double> distances_mm;  ///< distances of the first sources from the panel
  nlohmann::json report;
};

void declare_pack_flag(CLI::App& app, std::string& archive);

/// Writes a tar archive with one folder, `calibration`, whose README.txt has the command that
/// repeats the calibration. Sources keep their order by numbers before their names. The archive is
/// replaced when it is complete. Throws Error(Failed) if a file cannot be read or written, or if
/// the program tar is missing.
void write_photo_pack(const PhotoPack& pack, const std::filesystem::path& archive);

}  // namespace lenticule::tools
