// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/farm/bench_chunk.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/temporary.h"
#include "frames/sequence/sequence_joiner.h"

namespace lenticule::player {

namespace fs = std::filesystem;

void make_bench_chunk(const farm::WorkFolder& folder, uint64_t number, const ChunkWriting& write) {
  const farm::Chunk chunk = folder.plan().chunk(number);
  fs::create_directories(folder.attempts_folder(number));
  const TemporaryFolder attempt(folder.attempts_folder(number));
  const fs::path file = attempt.path() / "chunk.lts";
  frames::SequenceInfo info = folder.plan().film;
  info.first_frame = chunk.begin;
  farm::ChunkReport report{.plan = folder.identity(), .chunk = number};
  write(file, info, chunk, report);
  report.begin = chunk.begin;
  report.end = chunk.end;
  report.digest = frames::digest_of_file(file);
  report.bytes = fs::file_size(file);
  report.node = "bench";
  if (!folder.finish_chunk(attempt.path(), file, report))
    throw Error(ErrorKind::Failed, fmt::format("chunk {}: differs", number));
}

}  // namespace lenticule::player
