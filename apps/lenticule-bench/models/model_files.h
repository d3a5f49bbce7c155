// SPDX-License-Identifier: Apache-2.0
// Finds the models of `lenticule bench models` and names them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::bench {

struct ModelFile {
  std::filesystem::path file;
  std::string name;  ///< path below the folder it was found in, or its last two parts; no extension
  std::string stem;  ///< begins the names of its pictures: different for every model
};

/// Returns the .glb and .gltf files among `places`: files, and folders with all their sub-folders,
/// each folder's files sorted by name. Throws Error(Input) for a place that does not exist, and if
/// there is no model at all.
[[nodiscard]] std::vector<ModelFile> find_models(const std::vector<std::string>& places);

}  // namespace lenticule::bench
