// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/scratch_folder.h"

#include <filesystem>
#include <system_error>

#include "base/error.h"

namespace lenticule::tools {

ScratchFolder::ScratchFolder() : folder_(std::filesystem::temp_directory_path()) {}

std::string ScratchFolder::ring_socket() const {
  const std::filesystem::path folder = folder_.path() / "ring";
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (error)
    throw Error(ErrorKind::Failed,
                folder.string() + ": cannot create the folder: " + error.message());
  return (folder / "ring.sock").string();
}

}  // namespace lenticule::tools
