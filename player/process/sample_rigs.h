// SPDX-License-Identifier: Apache-2.0
// find_sample_rigs finds the sample rig files, for messages.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::player {

struct SampleRigs {
  std::filesystem::path folder;    ///< relative if it lies in the working folder
  std::vector<std::string> names;  ///< file names, sorted; empty if there is no such folder
};

/// Returns the rigs in share/lenticule/rigs of the installation or scenes/rigs of the source tree
/// that this program belongs to.
[[nodiscard]] SampleRigs find_sample_rigs();

}  // namespace lenticule::player
