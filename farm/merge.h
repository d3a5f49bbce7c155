// SPDX-License-Identifier: Apache-2.0
// merge_film joins the chunks of a plan into the film.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "farm/work_folder.h"

namespace lenticule::farm {

struct MergeOptions {
  bool partial = false;  ///< join the frames before the first chunk that is not done
  /// Longest time to wait for chunks that are missing: the folder of a network file system may show
  /// a file some seconds late.
  std::chrono::seconds wait{0};
  /// Called before each chunk; returning true stops the merge.
  std::function<bool(uint64_t chunk)> stops = [](uint64_t) { return false; };
  /// Pauses between two looks for missing chunks; tests replace it.
  std::function<void(std::chrono::milliseconds)> pause{};
};

struct MergeResult {
  uint64_t frames = 0;
  uint64_t chunks = 0;
  uint64_t bytes = 0;
  bool stopped = false;  ///< nothing was written
};

/// Returns the numbers of the chunks that are not done.
[[nodiscard]] std::vector<uint64_t> missing_chunks(const WorkFolder& folder);

/// Writes the film with the bytes that one process writes in one run. Throws Error(Input) that
/// names the chunks if some are missing, damaged or were rendered with other bytes by two
/// processes; a damaged chunk counts as missing from then on. Throws Error(Failed) if the film
/// cannot be written. An existing film stays unchanged if anything fails.
MergeResult merge_film(const WorkFolder& folder, const std::filesystem::path& film,
                       const MergeOptions& options = {});

/// Returns chunk numbers as "0-3,7".
[[nodiscard]] std::string ranges_text(const std::vector<uint64_t>& numbers);

}  // namespace lenticule::farm
