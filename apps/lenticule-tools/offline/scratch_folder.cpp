// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/scratch_folder.h"

#include <filesystem>

namespace lenticule::player {

ScratchFolder::ScratchFolder() : folder_(std::filesystem::temp_directory_path()) {}

}  // namespace lenticule::player
