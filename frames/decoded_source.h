// SPDX-License-Identifier: Apache-2.0
// What sources of pre-rendered frames share: threads that decode ahead into a bounded pool, rounds
// that follow each other without a gap, and a player that never waits for either.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"

namespace lenticule::frames {

/// What is played of the frames that there are, and by how much memory and how many threads.
struct DecodedRounds {
  FrameGeometry geometry;
  std::optional<Rate> rate = std::nullopt;
  /// The first round is [first, last), every later one [loop, last). Not empty.
  uint64_t first = 0, loop = 0, last = 0;
  /// With how many frames of them left out the first round begins; less than last - first.
  uint64_t skipped = 0;
  int pool_frames = 8;      ///< decoded frames in memory at most, at least 2
  int decoder_threads = 1;  ///< brought into 1..kMaxDecoderThreads
};

/// How one kind of file becomes frames.
class FrameDecoding {
 public:
  virtual ~FrameDecoding() = default;

  /// Asked once.
  [[nodiscard]] virtual DecodedRounds rounds() const = 0;
  /// Called by several threads at a time, each with a number of its own. Fills `to`, which is
  /// empty or a frame of that geometry; an empty text, or why there is no such frame. `next` is the
  /// frame that will probably be asked for after this one. May throw: that counts as a failure.
  [[nodiscard]] virtual std::string decode(int thread, uint64_t frame, uint64_t next,
                                           WovenFrame& to) = 0;
};

/// Rounds that are alike and fit the pool are decoded once and stay. A frame that cannot be decoded
/// ends the source with Failed when its turn comes, after every frame before it, and failure() says
/// why.
///
/// The player's calls come from one thread, take a lock that no decoding holds, and do not
/// allocate.
class DecodedSource : public FrameSource {
 public:
  static constexpr int kMaxDecoderThreads = 64;

  ~DecodedSource() override;
  DecodedSource(const DecodedSource&) = delete;
  DecodedSource& operator=(const DecodedSource&) = delete;

  [[nodiscard]] FrameGeometry geometry() const final { return rounds_.geometry; }
  [[nodiscard]] std::optional<Rate> rate() const final { return rounds_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const final {
    return rounds_.last - rounds_.first;
  }
  [[nodiscard]] PullStatus pull(LentFrame& out) final;
  void release(uint64_t token) final;
  [[nodiscard]] int max_lent() const final;
  /// Includes the first frames of the next round, which wait behind rewind().
  [[nodiscard]] uint64_t ready_count() const final;
  [[nodiscard]] bool saturated() const final;
  /// Works at the end and at the start of a round, not in its middle.
  [[nodiscard]] bool rewind() final;
  [[nodiscard]] int wake_fd() const final { return wake_.get(); }
  void service() final;
  [[nodiscard]] std::string failure() const final;

 protected:
  /// `name` is for messages. Throws Error(Failed) without descriptors.
  DecodedSource(const char* name, std::unique_ptr<FrameDecoding> decoding);
  [[nodiscard]] const FrameDecoding& decoding() const { return *decoding_; }

 private:
  enum class SlotState { Free, Decoding, Ready, Lent, Failed };

  /// Frames are counted in tickets through all rounds; ticket t lives in slot t mod slots.
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
  [[nodiscard]] uint64_t frame_of(uint64_t ticket) const;
  [[nodiscard]] bool is_ready(uint64_t ticket) const;
  [[nodiscard]] bool can_decode_next() const;
  void make_slots();
  void decode_ahead(int thread);
  [[nodiscard]] std::string decode(int thread, uint64_t ticket, WovenFrame& to);
  void wake() const;

  const DecodedRounds rounds_;
  UniqueFd wake_;
  bool resident_ = false;  ///< every frame has a slot of its own and stays there

  mutable std::mutex mutex_;
  std::condition_variable slot_freed_;
  std::vector<Slot> slots_;
  uint64_t next_decode_ = 0;  ///< ticket
  uint64_t next_pull_ = 0;    ///< ticket
  uint64_t round_begin_ = 0;  ///< ticket that this round began with
  uint64_t round_end_ = 0;    ///< ticket before which pull() stops until rewind()
  int decoding_now_ = 0;
  bool broken_ = false;  ///< a frame failed: nothing further is decoded
  bool failed_ = false;  ///< and its turn has come
  bool stopping_ = false;

  std::unique_ptr<FrameDecoding> decoding_;
  std::vector<std::jthread> threads_;  // last: they use everything above
};

}  // namespace lenticule::frames
