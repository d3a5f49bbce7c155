// SPDX-License-Identifier: Apache-2.0
// Saves a rig and keeps the previous one as a copy beside the file.
#pragma once

#include <filesystem>

#include "optics/rig.h"

namespace lenticule::optics {

/// Writes the rig to `file` atomically. If `file` exists, its bytes are first copied to
/// "STEM.NUMBER.toml" beside it, with a number above all existing ones, and synchronised. Returns
/// the path of the copy, empty if there was no old file. Throws Error(Input) for a rig that could
/// not be read back or an old file that cannot be read, Error(Failed) if writing fails: then `file`
/// is unchanged and there is no new copy. Two programs may call this at once: no copy overwrites
/// another.
[[nodiscard]] std::filesystem::path save_with_history(const Rig& rig,
                                                      const std::filesystem::path& file);

}  // namespace lenticule::optics
