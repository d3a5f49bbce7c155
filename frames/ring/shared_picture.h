// SPDX-License-Identifier: Apache-2.0
// SharedPicture passes the newest picture of one process to another through memory that both map.
// The writer never waits for the reader; a reader that is slow misses pictures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/unique_fd.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

struct SharedPictureHeader;

/// Thread safety: one thread.
class SharedPictureWriter {
 public:
  /// Throws Error(Failed) if there is no memory for two pictures of this size.
  SharedPictureWriter(int width, int height);

  /// Returns the descriptor that the reader needs.
  [[nodiscard]] int fd() const { return fd_.get(); }
  /// Copies a picture of XRGB words; `stride` is the number of words from one row to the next.
  void publish(const uint32_t* words, size_t stride) noexcept;

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
  SharedPictureReader(int fd, int width, int height);

  /// Copies the newest picture, width * height XRGB words; returns false, and leaves `words`
  /// unspecified, if there is none that was not read before.
  [[nodiscard]] bool read(std::vector<uint32_t>& words);

 private:
  size_t words_;
  Mapping mapping_;
  const SharedPictureHeader* header_ = nullptr;
  uint64_t read_ = 0;
};

}  // namespace lenticule::frames
