// SPDX-License-Identifier: Apache-2.0
// Makes chunks of a farm as `lenticule farm render` makes them, without a renderer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "farm/work_folder.h"
#include "frames/sequence/sequence_info.h"

namespace lenticule::player {

/// Writes the frames of a chunk to a file, and the digests of their bands to the report.
using ChunkWriting =
    std::function<void(const std::filesystem::path& file, const frames::SequenceInfo& info,
                       const farm::Chunk& chunk, farm::ChunkReport& report)>;

/// Makes a chunk done. Throws Error(Failed).
void make_bench_chunk(const farm::WorkFolder& folder, uint64_t number, const ChunkWriting& write);

}  // namespace lenticule::player
