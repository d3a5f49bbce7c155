// SPDX-License-Identifier: Apache-2.0
// SequenceReader reads any frame of a sequence container, in any order.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/decoded_source.h"
#include "frames/frame.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::frames {

/// FrameDecoder decodes frames of an open container, in one thread.
///
/// FrameDecoder allocates all memory in its constructor.
///
/// Lifetime: `layout` must outlive the decoder.
class FrameDecoder {
 public:
  FrameDecoder(int fd, const SequenceLayout& layout)
      : fd_(fd),
        layout_(layout),
        decoder_(layout.header.band_bytes(0)),
        entries_(static_cast<size_t>(layout.header.bands())),
        table_(layout.header.table_bytes()),
        payload_(layout.header.band_bytes(0)) {}

  /// Decodes a frame into `to` (frame_bytes() long). Returns false if any byte of the frame is
  /// damaged or cannot be read; `to` is undefined then. Neither throws nor allocates.
  [[nodiscard]] bool decode(uint64_t frame, std::span<uint8_t> to) noexcept {
    if (!read_band_table(fd_, layout_, frame, entries_, table_)) return false;
    for (int band = 0; band < layout_.header.bands(); ++band) {
      const BandEntry& entry = entries_[static_cast<size_t>(band)];
      const std::span<uint8_t> pixels =
          to.subspan(layout_.header.band_offset(band), layout_.header.band_bytes(band));
      if (!read_payload(entry) ||
          !decoder_.decode(entry.codec, std::span(payload_).first(entry.bytes), pixels))
        return false;
    }
    return true;
  }
  /// Checks only the checksums. Returns the same result as decode().
  [[nodiscard]] bool check(uint64_t frame) noexcept {
    if (!read_band_table(fd_, layout_, frame, entries_, table_)) return false;
    for (const BandEntry& entry : entries_)
      if (!read_payload(entry)) return false;
    return true;
  }

 private:
  [[nodiscard]] bool read_payload(const BandEntry& entry) noexcept {
    const std::span<uint8_t> payload = std::span(payload_).first(entry.bytes);
    return read_at(fd_, entry.offset, payload) && checksum_of(payload) == entry.checksum;
  }

  int fd_;
  const SequenceLayout& layout_;
  BandDecoder decoder_;
  std::vector<BandEntry> entries_;
  std::vector<uint8_t> table_;
  std::vector<uint8_t> payload_;
};

[[nodiscard]] inline bool is_unfinished_name(const std::filesystem::path& file) {
  return file.filename().string().ends_with(".lts.part");
}
/// Returns true for ".lts", and for ".lts.part", the name of an unfinished file.
[[nodiscard]] inline bool is_sequence_name(const std::filesystem::path& file) {
  return lower_case(file.filename().string()).ends_with(".lts") || is_unfinished_name(file);
}

inline constexpr const char* kNoFramesRemedy =
    "it ends within its first frame: --resume continues a .lts.part, a copy replaces a .lts";

class SequenceReader {
 public:
  /// Throws Error(Input) for a file that cannot be opened or is not a sequence (see
  /// read_sequence_layout).
  explicit SequenceReader(const std::filesystem::path& file)
      : fd_(open_regular_file(file, std::numeric_limits<uint64_t>::max()).descriptor),
        layout_(read_sequence_layout(fd_.get(), file.string())),
        missing_(missing_at_end(file, layout_)) {}
  SequenceReader(const SequenceReader&) = delete;
  SequenceReader& operator=(const SequenceReader&) = delete;

  [[nodiscard]] const SequenceInfo& info() const { return layout_.info; }
  [[nodiscard]] FrameGeometry geometry() const { return layout_.header.geometry; }
  [[nodiscard]] uint64_t frame_count() const { return layout_.frames.size(); }
  /// Returns false if the index is missing or damaged, and the frames were found without it.
  [[nodiscard]] bool has_index() const { return layout_.from_index; }
  [[nodiscard]] uint64_t file_bytes() const { return size_of(fd_.get()); }
  /// Returns the smallest number of frames that can be missing at the end: 0, or, if the finished
  /// file was cut, 1 or the number of frames up to the end of its loop.
  [[nodiscard]] uint64_t missing_frames() const { return missing_; }

  /// Returns a decoder for one thread.
  ///
  /// Lifetime: the reader must outlive the decoder.
  [[nodiscard]] FrameDecoder make_decoder() const { return {fd_.get(), layout_}; }

  /// Advise the kernel to fetch a frame, and that a frame's pages are no longer needed.
  void will_need(uint64_t frame) const noexcept { advise(frame, POSIX_FADV_WILLNEED); }
  void done_with(uint64_t frame) const noexcept { advise(frame, POSIX_FADV_DONTNEED); }

  /// Returns the numbers of the frames that do not decode. Calls `progress` for every frame; stops
  /// when `progress` returns false.
  [[nodiscard]] std::vector<uint64_t> find_damaged(
      const std::function<bool(uint64_t frame)>& progress = {}) const {
    FrameDecoder decoder = make_decoder();
    WovenFrame frame(geometry());
    std::vector<uint64_t> damaged;
    for (uint64_t number = 0; number < frame_count(); ++number) {
      if (!decoder.decode(number, frame.bytes())) damaged.push_back(number);
      if (progress && !progress(number)) break;
    }
    return damaged;
  }

 private:
  static uint64_t missing_at_end(const std::filesystem::path& file, const SequenceLayout& layout) {
    if (layout.has_every_frame || is_unfinished_name(file)) return 0;
    const uint64_t announced = layout.info.loop_end.value_or(0);
    return std::max<uint64_t>(announced, layout.frames.size() + 1) - layout.frames.size();
  }
  void advise(uint64_t frame, int advice) const noexcept {
    const uint64_t begin = layout_.frames[frame];
    if (begin == 0) return;
    const bool last = frame + 1 == layout_.frames.size();
    const uint64_t end = last ? layout_.data_end : layout_.frames[frame + 1];
    if (end > begin)
      static_cast<void>(::posix_fadvise(fd_.get(), static_cast<off_t>(begin),
                                        static_cast<off_t>(end - begin), advice));
  }

  UniqueFd fd_;
  SequenceLayout layout_;
  uint64_t missing_;
};

// SequenceSource plays pre-rendered frames from a sequence container. Its own threads decode ahead
// into a bounded pool. Damaged frames are replaced and counted, and playback continues.

struct SequenceSourceOptions {
  int pool_frames = 8;      ///< limit of decoded frames in memory, at least 2; allocated at once
  int decoder_threads = 1;  ///< 1..64, each decodes its own frame
  /// Frames [begin, end) of the file, 0-based, instead of all frames; must not be empty.
  uint64_t begin = 0;
  std::optional<uint64_t> end = std::nullopt;
  /// Number of frames omitted at the start of the first round; the number of all frames counts as
  /// none.
  uint64_t first = 0;
};

/// SequenceSource plays the first round from the first frame to the end of the loop, and every
/// later round from the beginning of the loop to its end, without a gap. A loop that fits the pool
/// is decoded once.
///
/// A frame with a damaged band is replaced by the nearest undamaged frame before it (or after it,
/// at the start). The source fails only if none of the 64 frames on either side can be read.
class SequenceSource final : public DecodedSource {
 public:
  /// Throws the Error(Input) of SequenceReader, also for a file without a frame, and for a range
  /// that the file does not contain.
  explicit SequenceSource(const std::filesystem::path& file,
                          const SequenceSourceOptions& options = {})
      : DecodedSource("sequence", std::make_unique<Frames>(file, options)),
        frames_(static_cast<const Frames&>(decoding())) {}

  [[nodiscard]] const SequenceInfo& info() const { return frames_.info(); }
  /// Every damaged frame that was decoded was replaced. Missing are the frames behind the end of a
  /// file that was cut: at least one.
  [[nodiscard]] FrameDamage damage() const override {
    const uint64_t damaged = frames_.damaged();
    return {.damaged = damaged, .missing = frames_.missing(), .repeated = damaged};
  }

 private:
  /// A larger file is read without keeping it in the page cache; a smaller file stays in the cache.
  static constexpr uint64_t kCachedFileBytes = uint64_t{1} << 30;
  static constexpr uint64_t kMaxDistance = 64;  ///< largest distance of a replacement in frames

  static uint64_t checked_end(const std::filesystem::path& file,
                              const SequenceSourceOptions& options, uint64_t count) {
    if (count == 0) throw input_error("{}: has no frames", file.string()).remedy(kNoFramesRemedy);
    const uint64_t end = options.end.value_or(count);
    if (options.begin < end && end <= count) return end;
    throw input_error("{}: has frames 0 to {}, not {} to {}", file.string(), count - 1,
                      options.begin, end - 1)
        .remedy("use a range of existing frames");
  }
  /// Frames holds the file and a decoder per thread.
  class Frames final : public FrameDecoding {
   public:
    Frames(const std::filesystem::path& file, const SequenceSourceOptions& options)
        : reader_(file),
          options_(options),
          end_(checked_end(file, options, reader_.frame_count())),
          spare_cache_(reader_.file_bytes() > kCachedFileBytes) {
      const int threads = std::clamp(options.decoder_threads, 1, kMaxDecoderThreads);
      decoders_.reserve(static_cast<size_t>(threads));
      for (int t = 0; t < threads; ++t) decoders_.push_back(reader_.make_decoder());
    }

    [[nodiscard]] const SequenceInfo& info() const { return reader_.info(); }
    [[nodiscard]] uint64_t damaged() const { return damaged_.load(); }
    [[nodiscard]] uint64_t missing() const { return options_.end ? 0 : reader_.missing_frames(); }

    [[nodiscard]] DecodedRounds rounds() const override {
      DecodedRounds rounds{.geometry = reader_.geometry(),
                           .rate = info().rate,
                           .first = options_.begin,
                           .loop = options_.begin,
                           .last = end_,
                           .pool_frames = options_.pool_frames,
                           .decoder_threads = options_.decoder_threads};
      const bool whole = options_.begin == 0 && !options_.end;
      if (whole && info().loop_begin < end_) {  // a truncated file may end before its loop does
        rounds.last = std::min(end_, info().loop_end.value_or(end_));
        rounds.loop = info().loop_begin;
      }
      rounds.skipped = options_.first < rounds.last - rounds.first ? options_.first : 0;
      return rounds;
    }

    std::string decode(int thread, uint64_t frame, uint64_t next, WovenFrame& to) override {
      reader_.will_need(next);
      if (to.geometry() != reader_.geometry()) to = WovenFrame(reader_.geometry());
      const bool decoded = decode_or_replace(decoders_[static_cast<size_t>(thread)], frame, to);
      if (spare_cache_) reader_.done_with(frame);
      return decoded
                 ? std::string()
                 : fmt::format("frame {}: neither this frame nor one near it can be read", frame);
    }

   private:
    [[nodiscard]] bool decode_or_replace(FrameDecoder& decoder, uint64_t frame, WovenFrame& to) {
      if (decoder.decode(frame, to.bytes())) return true;
      damaged_.fetch_add(1);
      const uint64_t back = std::min(frame, kMaxDistance);
      for (uint64_t distance = 1; distance <= back; ++distance)
        if (decoder.decode(frame - distance, to.bytes())) return true;
      const uint64_t ahead = std::min(reader_.frame_count() - 1 - frame, kMaxDistance);
      for (uint64_t distance = 1; distance <= ahead; ++distance)
        if (decoder.decode(frame + distance, to.bytes())) return true;
      return false;
    }

    SequenceReader reader_;
    SequenceSourceOptions options_;
    uint64_t end_;
    bool spare_cache_;
    std::atomic<uint64_t> damaged_{0};
    std::vector<FrameDecoder> decoders_;
  };

  const Frames& frames_;  ///< owned by DecodedSource
};

}  // namespace lenticule::frames
