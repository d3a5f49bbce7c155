// SPDX-License-Identifier: Apache-2.0
// Chunks and a film that are larger than the disk, to measure a merge of any size.
#pragma once

#include <cstdint>
#include <filesystem>
#include <thread>

#include "farm/work_folder.h"

namespace lenticule::player {

/// Makes a chunk done whose file is sparse: black frames, not compressed. Its report states that no
/// band repeats one of the chunk before. Throws Error(Failed).
void write_sparse_chunk(const farm::WorkFolder& folder, uint64_t number);

/// FilmDiscarder frees the disk blocks of unfinished files in a folder, but for the last 64 MiB of
/// each, while another thread writes them.
class FilmDiscarder {
 public:
  explicit FilmDiscarder(std::filesystem::path folder);

 private:
  std::jthread thread_;
};

}  // namespace lenticule::player
