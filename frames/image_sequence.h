// SPDX-License-Identifier: Apache-2.0
// Pre-rendered frames from picture files: a numbered sequence, a list, or one still. Decoded ahead
// of time by threads of its own into a bounded pool.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "frames/frame_source.h"
#include "frames/ring/unique_fd.h"

namespace lenticule::frames {

/// The files that a player's SOURCE argument means: every file of a pattern ("dir/%05d.png") from
/// the first number on, or the one file. Throws Error(Input) when there is none, or a number is
/// missing in between (named), Error(Usage) for a pattern that is none.
[[nodiscard]] std::vector<std::filesystem::path> list_frame_files(const std::string& source);

struct ImageSequenceOptions {
  /// Decoded frames kept in memory at most; at least 2. A sequence that fits is decoded once.
  int pool_frames = 8;
  /// Threads that decode ahead, 1..64. A 4K PNG takes one core about 0.13 s.
  int decoder_threads = 1;
  std::optional<Rate> rate = std::nullopt;
  /// Number of the file with which the first round begins, later ones beginning with the first;
  /// less than there are.
  uint64_t first = 0;
};

/// All files must have the first one's size. The first file is opened by the constructor, which
/// throws Error(Input) if it is no picture; a later file that cannot be read ends the sequence with
/// Failed when its turn comes, after every good frame before it, and failure() names it.
///
/// The player's calls come from one thread and only ever take a lock that no decoding holds.
class ImageSequence final : public FrameSource {
 public:
  explicit ImageSequence(std::vector<std::filesystem::path> files,
                         const ImageSequenceOptions& options = {});
  ~ImageSequence() override;
  ImageSequence(const ImageSequence&) = delete;
  ImageSequence& operator=(const ImageSequence&) = delete;

  [[nodiscard]] FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] std::optional<Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return files_.size(); }
  [[nodiscard]] PullStatus pull(LentFrame& out) override;
  void release(uint64_t token) override;
  [[nodiscard]] int max_lent() const override;
  /// Includes the first frames of the next round, which wait behind rewind().
  [[nodiscard]] uint64_t ready_count() const override;
  [[nodiscard]] bool saturated() const override;
  /// Works at the end and at the start of a round, not in its middle.
  [[nodiscard]] bool rewind() override;
  [[nodiscard]] int wake_fd() const override { return wake_.get(); }
  void service() override;
  [[nodiscard]] std::string failure() const override;

 private:
  enum class SlotState { Free, Decoding, Ready, Lent, Failed };

  /// Frames are counted in tickets through all rounds: ticket t is file t mod files and lives in
  /// slot t mod slots.
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    WovenFrame frame;
    std::string failure;
  };

  [[nodiscard]] Slot& slot_of(uint64_t ticket) { return slots_[ticket % slots_.size()]; }
  [[nodiscard]] const Slot& slot_of(uint64_t ticket) const {
    return slots_[ticket % slots_.size()];
  }
  /// Every file has a slot of its own and stays there.
  [[nodiscard]] bool resident() const { return slots_.size() == files_.size(); }
  [[nodiscard]] bool is_ready(uint64_t ticket) const;
  [[nodiscard]] bool can_decode_next() const;
  void decode_ahead();
  void decode(Slot& slot, const std::filesystem::path& file) const;
  void wake() const;

  const std::vector<std::filesystem::path> files_;
  const std::optional<Rate> rate_;
  const uint64_t first_;
  FrameGeometry geometry_;
  UniqueFd wake_;

  mutable std::mutex mutex_;
  std::condition_variable slot_freed_;
  std::vector<Slot> slots_;
  uint64_t next_decode_ = 0;  ///< ticket
  uint64_t next_pull_ = 0;    ///< ticket
  uint64_t round_end_ = 0;    ///< ticket before which pull() stops until rewind()
  int decoding_ = 0;
  bool broken_ = false;  ///< a file failed: nothing further is decoded
  bool failed_ = false;  ///< and its turn has come
  bool stopping_ = false;

  std::vector<std::jthread> decoders_;  // last: they use everything above
};

}  // namespace lenticule::frames
