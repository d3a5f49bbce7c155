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
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

/// Thread safety: one thread writes, another one reads; neither takes a lock or allocates.
class SoundRing {
 public:
  static constexpr uint64_t kFrames = uint64_t{1} << 16;   ///< 1.4 s at 48 kHz
  static constexpr uint64_t kHistory = uint64_t{1} << 14;  ///< 0.3 s of it are behind the player

  /// Makes the player's ring, and gets its memory. Throws Error(Failed).
  explicit SoundRing(int channels)
      : channels_(static_cast<size_t>(channels)),
        fd_(::memfd_create("lenticule-sound", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
    map(fd_ && ::fallocate(fd_.get(), 0, 0, static_cast<off_t>(bytes_of(channels_))) == 0 &&
        ::fcntl(fd_.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) == 0);
    (void)::mlock(mapping_.bytes().data(), mapping_.bytes().size());  // else the kernel may swap it
    header_ = new (mapping_.bytes().data()) Header;
  }
  /// Opens the decoder's end. Throws Error(Failed) if the descriptor is not that of such a ring.
  SoundRing(UniqueFd fd, int channels)
      : channels_(static_cast<size_t>(channels)), fd_(std::move(fd)) {
    struct stat status {};
    map(::fstat(fd_.get(), &status) == 0 &&
        status.st_size == static_cast<off_t>(bytes_of(channels_)));
    header_ = std::launder(reinterpret_cast<Header*>(mapping_.bytes().data()));
    made_ = header_->written.load(std::memory_order_relaxed);
  }

  [[nodiscard]] int fd() const { return fd_.get(); }

  // The decoder's thread.
  /// Returns the number of frames that can be written now.
  [[nodiscard]] uint64_t room() const noexcept {
    const uint64_t ahead = made_ - header_->floor.load(std::memory_order_acquire);
    return ahead < kFrames ? kFrames - ahead : 0;
  }
  /// Writes whole frames, at most room().
  void write(std::span<const float> samples) noexcept {
    for (size_t done = 0; done < samples.size();) {
      float* const to = place(made_ + done / channels_);
      const size_t run =
          std::min(samples.size() - done, static_cast<size_t>(samples_ + kFrames * channels_ - to));
      std::copy_n(samples.data() + done, run, to);
      done += run;
    }
    made_ += samples.size() / channels_;
    header_->written.store(made_, std::memory_order_release);
  }

  // The player's sound thread.
  /// Looks how far the decoder has come. Returns the number of the first frame that is not there.
  [[nodiscard]] uint64_t look() noexcept {
    written_ =
        std::clamp(header_->written.load(std::memory_order_acquire), written_, floor_ + kFrames);
    return written_;
  }
  [[nodiscard]] bool holds(uint64_t frame) const noexcept {
    return frame >= floor_ && frame < written_;
  }
  /// Returns true for a frame that was overwritten, or may be at any time.
  [[nodiscard]] bool is_gone(uint64_t frame) const noexcept { return frame < floor_; }
  /// Returns the samples of a frame that the ring holds.
  [[nodiscard]] const float* at(uint64_t frame) const noexcept { return place(frame); }
  /// Lets the decoder overwrite what lies more than kHistory before this frame. A frame that it has
  /// not reached yet frees the whole ring, so that the decoder can catch up.
  void play_from(uint64_t frame) noexcept {
    const uint64_t keep = std::min(frame > kHistory ? frame - kHistory : 0, written_);
    if (keep <= floor_) return;
    floor_ = keep;
    header_->floor.store(floor_, std::memory_order_release);
  }

 private:
  struct Header {
    alignas(64) std::atomic<uint64_t> written{0};
    alignas(64) std::atomic<uint64_t> floor{0};
  };
  static constexpr size_t kSamplesAt = 4096;
  static size_t bytes_of(size_t channels) {
    return kSamplesAt + kFrames * channels * sizeof(float);
  }

  void map(bool usable) {
    if (usable) mapping_ = Mapping(fd_.get(), 0, bytes_of(channels_), PROT_READ | PROT_WRITE);
    if (!mapping_)
      throw Error(ErrorKind::Failed,
                  std::string("sound: no shared memory for samples: ") + std::strerror(errno));
    samples_ = reinterpret_cast<float*>(mapping_.bytes().data() + kSamplesAt);
  }
  [[nodiscard]] float* place(uint64_t frame) const noexcept {
    return samples_ + frame % kFrames * channels_;
  }

  size_t channels_;
  UniqueFd fd_;
  Mapping mapping_;
  Header* header_ = nullptr;
  float* samples_ = nullptr;
  uint64_t made_ = 0;     ///< frames that the decoder has written
  uint64_t written_ = 0;  ///< those that the player has seen
  uint64_t floor_ = 0;    ///< the player's own; that in the memory is for the decoder
};

}  // namespace lenticule::frames
