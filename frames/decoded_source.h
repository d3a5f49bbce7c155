// SPDX-License-Identifier: Apache-2.0
// DecodedSource is the base class of sources of pre-rendered frames: threads decode ahead into a
// bounded pool, rounds follow each other without a gap, and the player never waits for the decoding
// or for the pool.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/image_io.h"

namespace lenticule::frames {

/// DecodedRounds selects the frames to play, the memory and the number of threads.
struct DecodedRounds {
  FrameGeometry geometry;
  std::optional<Rate> rate = std::nullopt;
  /// The first round is [first, last), every later one [loop, last); neither may be empty.
  uint64_t first = 0, loop = 0, last = 0;
  /// Number of frames omitted at the start of the first round; less than last - first.
  uint64_t skipped = 0;
  int pool_frames = 8;      ///< limit of decoded frames in memory, at least 2
  int decoder_threads = 1;  ///< clamped to 1..kMaxDecoderThreads
};

/// FrameDecoding decodes one kind of file into frames.
class FrameDecoding {
 public:
  virtual ~FrameDecoding() = default;

  /// Returns the rounds to play. Called once.
  [[nodiscard]] virtual DecodedRounds rounds() const = 0;
  /// Decodes one frame into `to`, which is empty or already has that geometry. Returns an empty
  /// text, or the cause of the failure; an exception counts as a failure too. `next` is the frame
  /// that will probably be requested next.
  ///
  /// Thread safety: several threads call this function at once, each with its own `thread` number.
  [[nodiscard]] virtual std::string decode(int thread, uint64_t frame, uint64_t next,
                                           WovenFrame& to) = 0;
};

/// DecodedSource implements FrameSource over a FrameDecoding. Rounds that are equal and fit the
/// pool are decoded once and stay in memory. A frame that cannot be decoded ends the source with
/// Failed when it is pulled, after all frames before it; failure() then returns the cause.
///
/// Thread safety: the player calls from one thread. Its calls take a lock that no thread holds
/// while decoding, and do not allocate.
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
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) final;
  void release(uint64_t token) final;
  [[nodiscard]] int max_acquired() const final;
  /// Includes the first frames of the next round, which pull() returns only after rewind().
  [[nodiscard]] uint64_t ready_count() const final;
  [[nodiscard]] bool saturated() const final;
  /// Succeeds at the end and at the start of a round, but not in its middle.
  [[nodiscard]] bool rewind() final;
  [[nodiscard]] int wake_fd() const final { return wake_.fd(); }
  void service() final;
  [[nodiscard]] std::string failure() const final;

 protected:
  /// Takes a name for messages. Throws Error(Failed) when the process has no free descriptor.
  DecodedSource(const char* name, std::unique_ptr<FrameDecoding> decoding);
  [[nodiscard]] const FrameDecoding& decoding() const { return *decoding_; }

 private:
  enum class SlotState { Free, Decoding, Ready, Acquired, Failed };

  /// Slot holds one frame. Tickets count frames through all rounds. A ticket gets any free slot, so
  /// that frames that the player keeps do not delay those after them.
  struct Slot {
    SlotState state = SlotState::Free;
    uint64_t ticket = 0;
    WovenFrame frame;
    std::string failure;
  };

  /// Returns the slot of a ticket that was given out and not pulled, or of a resident frame.
  [[nodiscard]] Slot& slot_of(uint64_t ticket) { return slots_[order_[ticket % slots_.size()]]; }
  [[nodiscard]] const Slot& slot_of(uint64_t ticket) const {
    return slots_[order_[ticket % slots_.size()]];
  }
  [[nodiscard]] uint64_t frame_of(uint64_t ticket) const;
  [[nodiscard]] bool is_ready(uint64_t ticket) const;
  [[nodiscard]] bool can_decode_next() const { return !broken_ && !free_.empty(); }
  void make_slots();
  void decode_ahead(int thread);
  [[nodiscard]] std::string decode(int thread, uint64_t ticket, WovenFrame& to);
  void wake() const;

  const DecodedRounds rounds_;
  WakeFd wake_;
  bool resident_ = false;  ///< every frame has its own slot and stays there

  mutable std::mutex mutex_;
  std::condition_variable slot_freed_;
  std::vector<Slot> slots_;
  std::vector<size_t> free_;   ///< indices of the free slots
  std::vector<size_t> order_;  ///< index of the slot of ticket t, at t mod slots
  uint64_t next_decode_ = 0;   ///< ticket
  uint64_t next_pull_ = 0;     ///< ticket
  uint64_t round_begin_ = 0;   ///< first ticket of this round
  uint64_t round_end_ = 0;     ///< pull() stops before this ticket until rewind()
  int decoding_now_ = 0;
  bool broken_ = false;  ///< a frame failed, so no further frame is decoded
  bool failed_ = false;  ///< the failed frame was pulled
  bool stopping_ = false;

  std::unique_ptr<FrameDecoding> decoding_;
  std::vector<std::jthread> threads_;  // last member: the threads use everything above
};

// ImageSequence plays pre-rendered frames from picture files: a numbered sequence, a list, or one
// still. Its own threads decode ahead into a bounded pool.

/// Returns the files of a player's SOURCE argument: every file of a pattern ("dir/%05d.png") from
/// the first number on, or the one file. Throws Error(Input) when there is no file or a number in
/// between is missing (named), Error(Usage) for an invalid pattern.
[[nodiscard]] std::vector<std::filesystem::path> list_frame_files(const std::string& source);

struct ImageSequenceOptions {
  /// Limit of decoded frames in memory; at least 2. A sequence that fits is decoded once.
  int pool_frames = 8;
  /// Number of threads that decode ahead, 1..64. Decoding a 4K PNG takes about 0.13 s of one core.
  int decoder_threads = 1;
  std::optional<Rate> rate = std::nullopt;
  /// Index of the file with which the first round begins, less than the number of files; later
  /// rounds begin with the first file.
  uint64_t first = 0;
  PictureUse use = PictureUse::Woven;
  /// Memory limit; fewer than pool_frames frames are kept if they would exceed it, but at least 2.
  uint64_t pool_bytes = std::numeric_limits<uint64_t>::max();
  /// Called with the properties in the first file's header, before memory is allocated; throws to
  /// refuse the file.
  std::function<void(const PictureInfo&)> accept = nullptr;
};

/// ImageSequence requires that all files have the first file's size. The constructor opens the
/// first file and throws Error(Input) if it is not a picture; a later file that cannot be read ends
/// the sequence when its frame is pulled.
class ImageSequence final : public DecodedSource {
 public:
  explicit ImageSequence(std::vector<std::filesystem::path> files,
                         const ImageSequenceOptions& options = {});
  [[nodiscard]] double pixel_aspect() const override { return pixel_aspect_; }

 private:
  class Files;
  explicit ImageSequence(std::unique_ptr<Files> files);

  double pixel_aspect_;
};

}  // namespace lenticule::frames
