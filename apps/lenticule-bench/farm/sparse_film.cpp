// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/farm/sparse_film.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "apps/lenticule-bench/farm/bench_chunk.h"
#include "base/error.h"
#include "base/temporary.h"
#include "base/unique_fd.h"
#include "frames/sequence/file_bytes.h"
#include "frames/sequence/sequence_joiner.h"
#include "frames/sequence/sequence_layout.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kKept = uint64_t{64} << 20;
constexpr std::chrono::milliseconds kPause{50};

/// SparseWriter writes pieces of a file and leaves holes between them.
class SparseWriter {
 public:
  explicit SparseWriter(const fs::path& file) : file_(file) {}

  void write(const std::vector<uint8_t>& bytes) {
    if (!frames::write_at(file_.fd(), end_, bytes))
      throw Error(ErrorKind::Failed, "sparse chunk: cannot write");
    end_ += bytes.size();
  }
  void skip(uint64_t bytes) { end_ += bytes; }
  [[nodiscard]] uint64_t end() const { return end_; }
  void finish() { file_.replace_target(); }

 private:
  TemporaryFile file_;
  uint64_t end_ = 0;
};

void write_black_frames(const fs::path& file, const frames::SequenceInfo& info, uint64_t count) {
  SparseWriter writer(file);
  frames::FileHeader header;
  std::vector<uint8_t> bytes;
  frames::append_file_start(info, header, bytes);
  writer.write(bytes);
  const std::vector<uint8_t> black(header.band_bytes(0));
  std::vector<uint64_t> offsets;
  for (uint64_t frame = 0; frame < count; ++frame) {
    offsets.push_back(writer.end());
    const uint64_t payload = writer.end() + frames::kFrameHeaderBytes + header.table_bytes();
    std::vector<uint8_t> table;
    uint64_t next = payload;
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
    writer.write(bytes);
    writer.skip(next - payload);
  }
  bytes.clear();
  frames::append_index(offsets, writer.end(), bytes);
  writer.write(bytes);
  writer.finish();
}

void discard_begin(const fs::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
  if (!fd) return;
  const uint64_t bytes = frames::size_of(fd.get());
  if (bytes > kKept)
    (void)::fallocate(fd.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0,
                      static_cast<off_t>(bytes - kKept));
}

}  // namespace

void write_sparse_chunk(const farm::WorkFolder& folder, uint64_t number) {
  make_bench_chunk(folder, number,
                   [&](const fs::path& file, const frames::SequenceInfo& info,
                       const farm::Chunk& chunk, farm::ChunkReport& report) {
                     write_black_frames(file, info, chunk.count());
                     const frames::WovenFrame frame(info.geometry);
                     const size_t bands = frames::band_digests(frame.view()).size();
                     report.first_bands = std::vector<uint64_t>(bands, 2 * number);
                     report.last_bands = std::vector<uint64_t>(bands, 2 * number + 1);
                   });
}

FilmDiscarder::FilmDiscarder(fs::path folder)
    : thread_([folder = std::move(folder)](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          std::error_code error;
          for (fs::directory_iterator at(folder, error), end; !error && at != end;
               at.increment(error))
            if (at->path().extension() == ".unfinished") discard_begin(at->path());
          std::this_thread::sleep_for(kPause);
        }
      }) {}

}  // namespace lenticule::player
