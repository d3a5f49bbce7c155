// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include "base/error.h"

namespace lenticule::frames {
namespace {

constexpr uint64_t kMaxDistance = 64;  ///< largest distance of a replacement in frames

uint64_t checked_end(const std::filesystem::path& file, const SequenceSourceOptions& options,
                     uint64_t count) {
  if (count == 0)
    throw Error(ErrorKind::Input, fmt::format("{}: has no frames", file.string()),
                "its writer was stopped before the first frame: continue with --resume");
  const uint64_t end = options.end.value_or(count);
  if (options.begin < end && end <= count) return end;
  throw Error(ErrorKind::Input,
              fmt::format("{}: has frames 0 to {}, not {} to {}", file.string(), count - 1,
                          options.begin, end - 1),
              "use a range of existing frames");
}

}  // namespace

/// Frames holds the file and a decoder per thread.
class SequenceSource::Frames final : public FrameDecoding {
 public:
  Frames(const std::filesystem::path& file, const SequenceSourceOptions& options)
      : reader_(file),
        options_(options),
        end_(checked_end(file, options, reader_.frame_count())),
        spare_cache_(reader_.file_bytes() > options.cached_file_bytes) {
    const int threads = std::clamp(options.decoder_threads, 1, kMaxDecoderThreads);
    decoders_.reserve(static_cast<size_t>(threads));
    for (int t = 0; t < threads; ++t) decoders_.push_back(reader_.make_decoder());
  }

  [[nodiscard]] const SequenceInfo& info() const { return reader_.info(); }
  [[nodiscard]] uint64_t damaged() const { return damaged_.load(); }
  [[nodiscard]] uint64_t missing() const { return options_.end ? 0 : reader_.missing_frames(); }
  [[nodiscard]] DecodedRounds rounds() const override;

  std::string decode(int thread, uint64_t frame, uint64_t next, WovenFrame& to) override {
    reader_.will_need(next);
    if (to.geometry() != reader_.geometry()) to = WovenFrame(reader_.geometry());
    const bool decoded = decode_or_replace(decoders_[static_cast<size_t>(thread)], frame, to);
    if (spare_cache_) reader_.done_with(frame);
    return decoded ? std::string()
                   : fmt::format("frame {}: neither this frame nor one near it can be read", frame);
  }

 private:
  [[nodiscard]] bool decode_or_replace(FrameDecoder& decoder, uint64_t frame, WovenFrame& to);

  SequenceReader reader_;
  SequenceSourceOptions options_;
  uint64_t end_;
  bool spare_cache_;
  std::atomic<uint64_t> damaged_{0};
  std::vector<FrameDecoder> decoders_;
};

DecodedRounds SequenceSource::Frames::rounds() const {
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

bool SequenceSource::Frames::decode_or_replace(FrameDecoder& decoder, uint64_t frame,
                                               WovenFrame& to) {
  if (decoder.decode(frame, to.bytes())) return true;
  damaged_.fetch_add(1);
  const uint64_t back = std::min(frame, kMaxDistance);
  for (uint64_t distance = 1; distance <= back; ++distance) {
    if (decoder.decode(frame - distance, to.bytes())) return true;
  }
  const uint64_t ahead = std::min(reader_.frame_count() - 1 - frame, kMaxDistance);
  for (uint64_t distance = 1; distance <= ahead; ++distance) {
    if (decoder.decode(frame + distance, to.bytes())) return true;
  }
  return false;
}

SequenceSource::SequenceSource(const std::filesystem::path& file,
                               const SequenceSourceOptions& options)
    : DecodedSource("sequence", std::make_unique<Frames>(file, options)),
      frames_(static_cast<const Frames&>(decoding())) {}

const SequenceInfo& SequenceSource::info() const {
  return frames_.info();
}

uint64_t SequenceSource::damaged_frames() const {
  return frames_.damaged();
}

FrameDamage SequenceSource::damage() const {
  const uint64_t damaged = frames_.damaged();
  return {.damaged = damaged, .missing = frames_.missing(), .repeated = damaged};
}

}  // namespace lenticule::frames
