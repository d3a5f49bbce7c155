// SPDX-License-Identifier: Apache-2.0
// Pre-rendered frames from a sequence container, decoded ahead by threads of their own into a
// bounded pool. What is damaged is replaced and counted; playing goes on.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "frames/frame_source.h"
#include "frames/ring/unique_fd.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::frames {

struct SequenceSourceOptions {
  int pool_frames = 8;      ///< decoded frames in memory at most, at least 2; allocated at once
  int decoder_threads = 1;  ///< 1..64, each works on a frame of its own
  /// Frames [begin, end) of the file, 0-based, instead of all; must not be empty.
  uint64_t begin = 0;
  std::optional<uint64_t> end = std::nullopt;
  /// With how many of them left out the first round begins; as many as there are count as none.
  uint64_t first = 0;
  /// A longer file is read past the page cache, a shorter one stays in it.
  uint64_t cached_file_bytes = uint64_t{1} << 30;
};

/// The first round is played from the first frame to the end of the loop, every later one from the
/// beginning of the loop to its end, without a gap. A loop that fits the pool is decoded once.
///
/// A frame with a damaged band is replaced by the nearest whole one before it (after it, at the
/// start). Only where none of the 64 on either side can be read the source has Failed.
///
/// The player's calls come from one thread, take a lock that no decoding holds, and do not
/// allocate.
class SequenceSource final : public FrameSource {
 public:
  /// Throws Error(Input) as SequenceReader does, for a file without a frame, and for a range that
  /// the file does not have.
  explicit SequenceSource(const std::filesystem::path& file,
                          const SequenceSourceOptions& options = {});
  ~SequenceSource() override;
  SequenceSource(const SequenceSource&) = delete;
  SequenceSource& operator=(const SequenceSource&) = delete;

  [[nodiscard]] const SequenceInfo& info() const { return reader_.info(); }
  /// Frames that were decoded and were not what had been written: each was replaced.
  [[nodiscard]] uint64_t damaged_frames() const { return damaged_.load(); }

  [[nodiscard]] FrameGeometry geometry() const override { return reader_.geometry(); }
  [[nodiscard]] std::optional<Rate> rate() const override { return reader_.info().rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return last_ - first_; }
  [[nodiscard]] PullStatus pull(LentFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_lent() const override;
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  /// Works at the end and at the start of a round, not in its middle.
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return wake_.get(); }
  void service() override;
  [[nodiscard]] std::string failure() const override;

 private:
  enum class SlotState { Free, Decoding, Ready, Lent, Failed };

  /// Frames are counted in tickets through all rounds; ticket t lives in slot t mod slots.
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    WovenFrame frame;
  };

  [[nodiscard]] Slot& slot_of(uint64_t ticket) { return slots_[ticket % slots_.size()]; }
  [[nodiscard]] const Slot& slot_of(uint64_t ticket) const {
    return slots_[ticket % slots_.size()];
  }
  [[nodiscard]] uint64_t frame_of(uint64_t ticket) const;
  [[nodiscard]] uint64_t loop_length() const { return last_ - loop_; }
  [[nodiscard]] bool is_ready(uint64_t ticket) const;
  [[nodiscard]] bool can_decode_next() const;
  void decode_ahead(FrameDecoder& decoder);
  [[nodiscard]] bool decode_or_replace(FrameDecoder& decoder, uint64_t frame, WovenFrame& to);
  void wake() const;

  SequenceReader reader_;
  uint64_t first_ = 0;     ///< frame of the file that the first round begins with
  uint64_t loop_ = 0;      ///< frame that every later round begins with
  uint64_t last_ = 0;      ///< behind the last frame of every round
  uint64_t skipped_ = 0;   ///< frames that the first round leaves out
  bool resident_ = false;  ///< every frame has a slot of its own and stays there
  bool spare_cache_ = false;
  UniqueFd wake_;
  std::atomic<uint64_t> damaged_{0};

  mutable std::mutex mutex_;
  std::condition_variable slot_freed_;
  std::vector<Slot> slots_;
  uint64_t next_decode_ = 0;  ///< ticket
  uint64_t next_pull_ = 0;    ///< ticket
  uint64_t round_begin_ = 0;  ///< ticket that this round began with
  uint64_t round_end_ = 0;    ///< ticket before which pull() stops until rewind()
  int decoding_ = 0;
  bool broken_ = false;
  bool failed_ = false;
  bool stopping_ = false;

  std::vector<FrameDecoder> decoders_;
  std::vector<std::jthread> threads_;  // last: they use everything above
};

}  // namespace lenticule::frames
