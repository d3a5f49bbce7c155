// SPDX-License-Identifier: Apache-2.0
// SharedPicture passes the newest picture of one process to another through memory that both map.
// The writer never waits for the reader; a reader that is slow misses pictures.
//
// Pictures are written in turn into two slots. A picture's number is stored before it is written
// and again when it is complete, so that a reader notices a slot that changed while it was copied.
#pragma once

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

struct SharedPictureHeader {
  std::atomic<uint64_t> begun;
  std::atomic<uint64_t> published;  ///< number of the newest complete picture; 0 = none
};
static_assert(std::atomic<uint64_t>::is_always_lock_free);

inline constexpr size_t kPictureHeaderBytes = 64;
inline constexpr int kAttempts =
    3;  // a writer that overtakes a reader so often is faster than displays

inline size_t picture_bytes(size_t words) { return words * sizeof(uint32_t); }

/// Thread safety: one thread.
class SharedPictureWriter {
 public:
  /// Throws Error(Failed) if there is no memory for two pictures of this size.
  SharedPictureWriter(int width, int height)
      : width_(static_cast<size_t>(width)),
        height_(static_cast<size_t>(height)),
        fd_(::memfd_create("lenticule-picture", MFD_CLOEXEC)) {
    const size_t bytes = kPictureHeaderBytes + 2 * picture_bytes(width_ * height_);
    if (fd_ && ::ftruncate(fd_.get(), static_cast<off_t>(bytes)) == 0)
      mapping_ = Mapping(fd_.get(), 0, bytes, PROT_READ | PROT_WRITE);
    if (!mapping_)
      throw failed_error("no memory for two pictures of {}x{} pixels: {}", width, height,
                         std::strerror(errno));
    header_ = reinterpret_cast<SharedPictureHeader*>(mapping_.bytes().data());
  }

  /// Returns the descriptor that the reader needs.
  [[nodiscard]] int fd() const { return fd_.get(); }
  /// Copies a picture of XRGB words; `stride` is the number of words from one row to the next.
  void publish(const uint32_t* words, size_t stride) noexcept {
    const uint64_t number = ++published_;
    header_->begun.store(number, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    uint8_t* to = mapping_.bytes().data() + kPictureHeaderBytes +
                  number % 2 * picture_bytes(width_ * height_);
    for (size_t j = 0; j < height_; ++j, to += picture_bytes(width_))
      std::memcpy(to, words + j * stride, picture_bytes(width_));
    header_->published.store(number, std::memory_order_release);
  }

 private:
  size_t width_;
  size_t height_;
  UniqueFd fd_;
  Mapping mapping_;
  SharedPictureHeader* header_ = nullptr;
  uint64_t published_ = 0;
};

/// Thread safety: one thread.
class SharedPictureReader {
 public:
  /// Throws Error(Input) if the descriptor holds no pictures of this size.
  SharedPictureReader(int fd, int width, int height)
      : words_(static_cast<size_t>(width) * static_cast<size_t>(height)) {
    const size_t bytes = kPictureHeaderBytes + 2 * picture_bytes(words_);
    struct stat status {};
    if (::fstat(fd, &status) == 0 && status.st_size >= static_cast<off_t>(bytes))
      mapping_ = Mapping(fd, 0, bytes, PROT_READ);
    if (!mapping_)
      throw input_error("descriptor {}: holds no pictures of {}x{} pixels", fd, width, height);
    header_ = reinterpret_cast<const SharedPictureHeader*>(mapping_.bytes().data());
  }

  /// Copies the newest picture, width * height XRGB words; returns false, and leaves `words`
  /// unspecified, if there is none that was not read before.
  [[nodiscard]] bool read(std::vector<uint32_t>& words) {
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const uint64_t number = header_->published.load(std::memory_order_acquire);
      if (number == read_) return false;
      words.resize(words_);
      std::memcpy(
          words.data(),
          mapping_.bytes().data() + kPictureHeaderBytes + number % 2 * picture_bytes(words_),
          picture_bytes(words_));
      std::atomic_thread_fence(std::memory_order_acquire);
      // The slot is used again by the picture after the next.
      if (header_->begun.load(std::memory_order_relaxed) >= number + 2) continue;
      read_ = number;
      return true;
    }
    return false;
  }

 private:
  size_t words_;
  Mapping mapping_;
  const SharedPictureHeader* header_ = nullptr;
  uint64_t read_ = 0;
};

}  // namespace lenticule::frames
