// SPDX-License-Identifier: Apache-2.0
// DecodedSource is the base class of sources of pre-rendered frames: threads decode ahead into a
// bounded pool, rounds follow each other without a gap, and the player never waits for the decoding
// or for the pool.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "frames/image_io.h"

namespace lenticule::frames {

/// DecodedRounds selects the frames to play, the memory and the number of threads.
struct DecodedRounds {
  FrameGeometry geometry;
  std::optional<Rate> rate = std::nullopt;
  /// The first round is [first, last), every later one [loop, last); neither may be empty. Frames
  /// that are pulled are counted from `first`, as a jump counts them.
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

  ~DecodedSource() override {
    for (std::jthread& thread : threads_) thread.request_stop();  // all, before one is awaited
  }

  [[nodiscard]] FrameGeometry geometry() const final { return rounds_.geometry; }
  [[nodiscard]] std::optional<Rate> rate() const final { return rounds_.rate; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const final {
    return rounds_.last - rounds_.first;
  }
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) final {
    const std::lock_guard lock(mutex_);
    if (next_pull_ == round_end_) return PullStatus::End;
    Slot& slot = slot_of(next_pull_);
    if (slot.state == SlotState::Failed) {
      failed_ = true;
      return PullStatus::Failed;
    }
    if (!is_ready(next_pull_)) return PullStatus::NotYet;
    if (!resident_) slot.state = SlotState::Acquired;
    out = {.frame = slot.frame.view(),
           .number = frame_of(next_pull_) - rounds_.first,
           .token = static_cast<uint64_t>(&slot - slots_.data())};
    ++next_pull_;
    return PullStatus::Ready;
  }
  void release(uint64_t token) final {
    if (resident_) return;
    {
      const std::lock_guard lock(mutex_);
      LENTICULE_CHECK(token < slots_.size() && slots_[token].state == SlotState::Acquired);
      slots_[token].state = SlotState::Free;
      free_.push_back(token);
    }
    slot_freed_.notify_one();
  }
  [[nodiscard]] int max_acquired() const final {
    return resident_ ? std::numeric_limits<int>::max() : static_cast<int>(slots_.size()) - 1;
  }
  /// Includes the first frames of the next round, which pull() returns only after rewind().
  [[nodiscard]] uint64_t ready_count() const final {
    const std::lock_guard lock(mutex_);
    uint64_t ready = 0;
    while (ready < slots_.size() && is_ready(next_pull_ + ready)) ++ready;
    return ready;
  }
  [[nodiscard]] bool saturated() const final {
    const std::lock_guard lock(mutex_);
    return decoding_now_ == 0 && !can_decode_next();
  }
  /// Succeeds at the end and at the start of a round, but not in its middle.
  [[nodiscard]] bool rewind() final {
    const std::lock_guard lock(mutex_);
    if (next_pull_ == round_begin_) return true;
    if (next_pull_ != round_end_) return false;
    round_begin_ = round_end_;
    round_end_ += rounds_.last - rounds_.loop;
    return true;
  }
  [[nodiscard]] int wake_fd() const final { return wake_.fd(); }
  void service() final { wake_.drain(); }
  [[nodiscard]] std::string failure() const final {
    const std::lock_guard lock(mutex_);
    return failed_ ? slot_of(next_pull_).failure : std::string();
  }

 protected:
  /// Takes a name for messages. Throws Error(Failed) when the process has no free descriptor.
  DecodedSource(const char* name, std::unique_ptr<FrameDecoding> decoding)
      : rounds_(decoding->rounds()), wake_(name), decoding_(std::move(decoding)) {
    LENTICULE_CHECK(rounds_.first < rounds_.last && rounds_.loop < rounds_.last);
    LENTICULE_CHECK(rounds_.skipped < rounds_.last - rounds_.first);
    next_decode_ = next_pull_ = round_begin_ = rounds_.skipped;
    round_end_ = rounds_.last - rounds_.first;
    make_slots();
    const int threads = std::clamp(rounds_.decoder_threads, 1, kMaxDecoderThreads);
    try {
      for (int t = 0; t < threads; ++t)
        threads_.emplace_back([this, t](const std::stop_token& stop) { decode_ahead(t, stop); });
    } catch (const std::system_error&) {  // the limit of threads
      if (threads_.empty()) throw;
    }
  }
  [[nodiscard]] const FrameDecoding& decoding() const { return *decoding_; }

 private:
  static constexpr int kMinPoolFrames = 2;  // one displayed, one being decoded
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
  [[nodiscard]] uint64_t frame_of(uint64_t ticket) const {
    const uint64_t first_round = rounds_.last - rounds_.first;
    if (ticket < first_round) return rounds_.first + ticket;
    return rounds_.loop + (ticket - first_round) % (rounds_.last - rounds_.loop);
  }
  [[nodiscard]] bool is_ready(uint64_t ticket) const {
    const Slot& slot = slot_of(ticket);
    // A resident frame may be acquired any number of times; no thread writes it any more.
    const uint64_t round = resident_ ? slots_.size() : UINT64_MAX;
    return slot.state == SlotState::Ready && slot.ticket % round == ticket % round;
  }
  [[nodiscard]] bool can_decode_next() const { return !broken_ && !free_.empty(); }
  void make_slots() {
    const uint64_t count = rounds_.last - rounds_.first;
    const uint64_t pool = static_cast<uint64_t>(std::max(rounds_.pool_frames, kMinPoolFrames));
    resident_ = pool >= count && rounds_.loop == rounds_.first;
    slots_.resize(resident_ ? count : std::clamp<uint64_t>(count, kMinPoolFrames, pool));
    for (size_t slot = slots_.size(); slot-- > 0;) free_.push_back(slot);
    order_.resize(slots_.size());
  }
  void decode_ahead(int thread, const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (slot_freed_.wait(lock, stop, [this] { return can_decode_next(); }) &&
           !stop.stop_requested()) {
      const uint64_t ticket = next_decode_++;
      order_[ticket % slots_.size()] = free_.back();
      free_.pop_back();
      Slot& slot = slot_of(ticket);
      slot.state = SlotState::Decoding;
      slot.ticket = ticket;
      ++decoding_now_;

      lock.unlock();
      slot_freed_.notify_one();  // another decoder may have waited for this slot, not for the next
      slot.failure = decode(thread, ticket, slot.frame);
      lock.lock();

      --decoding_now_;
      broken_ = broken_ || !slot.failure.empty();
      slot.state = slot.failure.empty() ? SlotState::Ready : SlotState::Failed;
      wake();
    }
  }
  [[nodiscard]] std::string decode(int thread, uint64_t ticket, WovenFrame& to) {
    try {
      return decoding_->decode(thread, frame_of(ticket), frame_of(ticket + 1), to);
    } catch (const std::exception& error) {
      const std::string why = error.what();
      return why.empty() ? fmt::format("frame {}: cannot decode", frame_of(ticket)) : why;
    }
  }
  void wake() const { wake_.signal(); }

  const DecodedRounds rounds_;
  WakeFd wake_;
  bool resident_ = false;  ///< every frame has its own slot and stays there

  mutable std::mutex mutex_;
  std::condition_variable_any slot_freed_;
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

  std::unique_ptr<FrameDecoding> decoding_;
  std::vector<std::jthread> threads_;  // last member: the threads use everything above
};

// ImageSequence plays pre-rendered frames from picture files: a numbered sequence, a list, or one
// still. Its own threads decode ahead into a bounded pool.

/// Returns the files of a player's SOURCE argument: every file of a pattern ("dir/%05d.png") from
/// the first number on, or the one file. Throws Error(Input) when there is no file or a number in
/// between is missing (named), Error(Usage) for an invalid pattern.
[[nodiscard]] inline std::vector<std::filesystem::path> list_frame_files(
    const std::string& source) {
  if (!FilePattern::looks_like_pattern(source)) return {source};
  const FilePattern pattern(source);
  const std::vector<uint64_t> numbers = pattern.existing_or_throw();
  std::vector<std::filesystem::path> files;
  for (const uint64_t number : numbers) {
    const uint64_t expected = numbers.front() + files.size();
    if (number != expected)
      throw input_error("{}: missing between {} and {}", pattern.path(expected).string(),
                        pattern.path(numbers.front()).filename().string(),
                        pattern.path(numbers.back()).filename().string());
    files.push_back(pattern.path(number));
  }
  return files;
}

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
                         const ImageSequenceOptions& options = {})
      : ImageSequence(std::make_unique<Files>(std::move(files), options)) {}
  [[nodiscard]] double pixel_aspect() const override { return pixel_aspect_; }

 private:
  class Files final : public FrameDecoding {
   public:
    Files(std::vector<std::filesystem::path> files, const ImageSequenceOptions& options)
        : files_(std::move(files)), options_(options), first_(header_of_first()) {
      if (options_.accept) options_.accept(first_);
    }

    [[nodiscard]] double pixel_aspect() const { return upright_pixel_aspect(first_); }

    [[nodiscard]] DecodedRounds rounds() const override {
      const FrameGeometry geometry = oriented_geometry(first_.geometry, first_.orientation);
      const uint64_t fit = options_.pool_bytes / geometry.frame_bytes();
      const auto most = static_cast<uint64_t>(std::max(options_.pool_frames, 2));
      return {.geometry = geometry,
              .rate = options_.rate,
              .last = files_.size(),
              .skipped = options_.first,
              .pool_frames = static_cast<int>(std::clamp<uint64_t>(fit, 2, most)),
              .decoder_threads = options_.decoder_threads};
    }

    std::string decode(int /*thread*/, uint64_t frame, uint64_t /*next*/, WovenFrame& to) override {
      read_woven_into(files_[frame], oriented_geometry(first_.geometry, first_.orientation), to,
                      options_.use);
      return {};
    }

   private:
    [[nodiscard]] PictureInfo header_of_first() const {
      if (files_.empty()) throw Error(ErrorKind::Input, "image sequence: no files");
      return probe_picture(files_.front(), options_.use);
    }

    std::vector<std::filesystem::path> files_;
    ImageSequenceOptions options_;
    PictureInfo first_;
  };
  explicit ImageSequence(std::unique_ptr<Files> files)
      : DecodedSource("image sequence", std::move(files)),
        pixel_aspect_(static_cast<const Files&>(decoding()).pixel_aspect()) {}

  double pixel_aspect_;
};

}  // namespace lenticule::frames
