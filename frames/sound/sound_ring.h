// SPDX-License-Identifier: Apache-2.0
// SoundRing passes samples from the confined decoder to the player through shared memory.
//
// The decoder writes frame after frame (one sample of each channel); frame i lies at place i modulo
// kFrames. It never overtakes the player by more than the ring holds: `floor` is the first frame
// that the player may still read, kHistory frames before the one that it plays, so that a step back
// after a pause finds its samples. The player trusts nothing in the memory: a wrong number gives
// wrong sound, and no access outside of the ring.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

/// Thread safety: one thread writes, another one reads; neither takes a lock or allocates.
class SoundRing {
 public:
  static constexpr int kRate = 48'000, kChannels = 2;
  static constexpr uint64_t kFrames = uint64_t{1} << 16;   ///< 1.4 s
  static constexpr uint64_t kHistory = uint64_t{1} << 14;  ///< 0.3 s of it are behind the player
  static constexpr uint64_t kMost = uint64_t{1} << 40;     ///< largest number that is believed
  using Frame = std::array<float, kChannels>;

  /// Makes the player's ring, and gets its memory. Throws Error(Failed).
  SoundRing() : SoundRing(make()) {
    (void)::mlock(mapping_.bytes().data(), mapping_.bytes().size());  // else the kernel may swap it
  }
  /// Opens the decoder's end. Throws Error(Failed) if the descriptor is not that of such a ring.
  explicit SoundRing(UniqueFd fd) : fd_(std::move(fd)) {
    struct stat status {};
    if (::fstat(fd_.get(), &status) == 0 && status.st_size == sizeof(Memory))
      mapping_ = Mapping(fd_.get(), 0, sizeof(Memory), PROT_READ | PROT_WRITE);
    if (!mapping_)
      throw failed_error("sound: no shared memory for samples: {}", std::strerror(errno));
    memory_ = reinterpret_cast<Memory*>(mapping_.bytes().data());
    made_ = memory_->written.load(std::memory_order_relaxed);
  }

  [[nodiscard]] int fd() const { return fd_.get(); }

  // The decoder's thread.
  /// Returns the number of frames that can be written now.
  [[nodiscard]] uint64_t room() const noexcept {
    const uint64_t ahead = made_ - memory_->floor.load(std::memory_order_acquire);
    return ahead < kFrames ? kFrames - ahead : 0;
  }
  /// Writes at most room() frames.
  void write(std::span<const Frame> frames) noexcept {
    for (const Frame& frame : frames) memory_->frames[made_++ % kFrames] = frame;
    memory_->written.store(made_, std::memory_order_release);
  }
  /// States the length of a round that the decoder has found by itself, before it writes the next.
  void set_round(uint64_t frames) noexcept { memory_->round.store(frames); }
  void count_damage() noexcept { memory_->damaged.fetch_add(1); }

  // The player's sound thread.
  /// Looks how far the decoder has come. Returns the number of the first frame that is not there.
  uint64_t look() noexcept {
    written_ =
        std::clamp(memory_->written.load(std::memory_order_acquire), written_, floor_ + kFrames);
    return written_;
  }
  /// Returns the frames of a round, at most kMost; 0 if the decoder has not found them.
  [[nodiscard]] uint64_t round() const noexcept { return std::min(memory_->round.load(), kMost); }
  /// Returns the number of packets that could not be decoded. Any thread.
  [[nodiscard]] uint64_t damaged() const noexcept {
    return std::min(memory_->damaged.load(), kMost);
  }
  [[nodiscard]] bool holds(uint64_t frame) const noexcept {
    return frame >= floor_ && frame < written_;
  }
  /// Returns true for a frame that was overwritten, or may be at any time.
  [[nodiscard]] bool is_gone(uint64_t frame) const noexcept { return frame < floor_; }
  /// Returns a frame that the ring holds.
  [[nodiscard]] const Frame& at(uint64_t frame) const noexcept {
    return memory_->frames[frame % kFrames];
  }
  /// Lets the decoder overwrite what lies more than kHistory before this frame. A frame that it has
  /// not reached yet frees the whole ring, so that the decoder can catch up.
  void play_from(uint64_t frame) noexcept {
    floor_ = std::max(floor_, std::min(frame - std::min(frame, kHistory), written_));
    memory_->floor.store(floor_, std::memory_order_release);
  }

 private:
  struct Memory {
    alignas(64) std::atomic<uint64_t> written, floor, round, damaged;
    alignas(4096) std::array<Frame, kFrames> frames;
  };
  static UniqueFd make() {
    UniqueFd fd(::memfd_create("lenticule-sound", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    const bool made =
        fd && ::fallocate(fd.get(), 0, 0, sizeof(Memory)) == 0 &&
        ::fcntl(fd.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) == 0;
    return made ? std::move(fd) : UniqueFd();
  }

  UniqueFd fd_;
  Mapping mapping_;
  Memory* memory_ = nullptr;
  uint64_t made_ = 0;     ///< frames that the decoder has written
  uint64_t written_ = 0;  ///< those that the player has seen
  uint64_t floor_ = 0;    ///< the player's own; that in the memory is for the decoder
};

}  // namespace lenticule::frames
