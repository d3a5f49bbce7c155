// SPDX-License-Identifier: Apache-2.0
// Merges a film that is larger than the memory, and mostly holes: sparse chunks are merged while
// the blocks of the film are freed again.
#include <fcntl.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "base/temporary.h"
#include "base/unique_fd.h"
#include "farm/sequence_joiner.h"
#include "farm/work_folder.h"
#include "frames/sequence/sequence_format.h"
#include "small_farm.h"

namespace lenticule::farm {
namespace {

namespace fs = std::filesystem;

/// Writes black frames whose bands are holes of the file.
void write_black_frames(const fs::path& file, const frames::SequenceInfo& info, uint64_t count) {
  const UniqueFd fd(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  ASSERT_TRUE(fd);
  uint64_t end = 0;
  const auto write = [&](const std::vector<uint8_t>& bytes) {
    ASSERT_TRUE(frames::write_at(fd.get(), end, bytes));
    end += bytes.size();
  };
  frames::FileHeader header;
  std::vector<uint8_t> bytes;
  frames::append_file_start(info, header, bytes);
  write(bytes);
  const std::vector<uint8_t> black(header.band_bytes(0));
  std::vector<uint64_t> offsets;
  for (uint64_t frame = 0; frame < count; ++frame) {
    offsets.push_back(end);
    const uint64_t payload = end + frames::kFrameHeaderBytes + header.table_bytes();
    uint64_t next = payload;
    std::vector<uint8_t> table;
    for (int band = 0; band < header.bands(); ++band) {
      const size_t size = header.band_bytes(band);
      frames::append_band_entry({.offset = next,
                                 .bytes = static_cast<uint32_t>(size),
                                 .checksum = frames::checksum_of(std::span(black).first(size))},
                                table);
      next += size;
    }
    bytes.clear();
    frames::append_frame_header({.number = frame,
                                 .payload_bytes = next - payload,
                                 .table_checksum = frames::checksum_of(table)},
                                header.bands(), bytes);
    bytes.insert(bytes.end(), table.begin(), table.end());
    write(bytes);
    end = next;
  }
  bytes.clear();
  frames::append_index(offsets, end, bytes);
  write(bytes);
}

void finish_sparse_chunk(const WorkFolder& folder, uint64_t number) {
  const Chunk chunk = folder.plan().chunk(number);
  fs::create_directories(folder.attempts_folder(number));
  const TemporaryFolder attempt(folder.attempts_folder(number));
  const fs::path file = attempt.path() / "chunk.lts";
  frames::SequenceInfo info = folder.plan().film;
  info.first_frame = chunk.begin;
  write_black_frames(file, info, chunk.count());
  ChunkReport report{.plan = folder.identity(), .chunk = number};
  report.begin = chunk.begin;
  report.end = chunk.end;
  report.node = "node";
  report.digest = digest_of_file(file);
  report.bytes = fs::file_size(file);
  const size_t bands = band_digests(frames::WovenFrame(info.geometry).view()).size();
  report.first_bands = std::vector<uint64_t>(bands, 2 * number);
  report.last_bands = std::vector<uint64_t>(bands, 2 * number + 1);
  ASSERT_TRUE(folder.finish_chunk(attempt.path(), file, report));
}

uint64_t peak_resident_mib() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) / 1024;
  return 0;
}

TEST(MergeOfALargeFilm, NeedsLittleMemory) {
  Plan plan = test::small_plan(0, 40, 20);
  plan.film.geometry = {.width = 3840, .height = 2160};
  const test::SmallFarm farm(plan);
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk)
    finish_sparse_chunk(farm.folder(), chunk);
  // Frees the blocks of the film while it is written.
  const fs::path folder = farm.film().parent_path();
  const std::jthread discarder([&folder](const std::stop_token& stop) {
    constexpr off_t kKept = 64 << 20;
    for (; !stop.stop_requested(); std::this_thread::sleep_for(std::chrono::milliseconds(50))) {
      std::error_code gone;
      for (fs::directory_iterator at(folder, gone), end; !gone && at != end; at.increment(gone)) {
        const UniqueFd fd(::open(at->path().c_str(), O_WRONLY | O_CLOEXEC));
        const auto size = fd ? static_cast<off_t>(frames::size_of(fd.get())) : 0;
        if (at->path().extension() == ".unfinished" && size > kKept)
          (void)::fallocate(fd.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, size - kKept);
      }
    }
  });
  std::ofstream("/proc/self/clear_refs") << "5";  // resets the peak
  EXPECT_GT(merge_film(farm.folder(), farm.film()).bytes, 950'000'000U);
  EXPECT_LT(peak_resident_mib(), 200U);
}

}  // namespace
}  // namespace lenticule::farm
