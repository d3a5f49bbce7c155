// SPDX-License-Identifier: Apache-2.0
// FrameMemory shares a copy of the displayed frame with clients of the control socket. All clients
// share one memory, so that no number of requests takes more.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <memory>
#include <string_view>

#include "base/unique_fd.h"
#include "frames/frame.h"

namespace lenticule::player {

/// Layout: a serial number (8 bytes, in the order of this machine), then at offset 64 the pixels,
/// then the text. The serial number is 0 while the content changes.
///
/// Thread safety: one thread.
class FrameMemory {
 public:
  static constexpr size_t kPixelsAt = 64;
  static constexpr size_t kMaxText = size_t{8} << 20;

  /// Throws Error(Failed) if there is no memory.
  explicit FrameMemory(const frames::FrameGeometry& geometry);
  ~FrameMemory();
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  /// Replaces the content and returns its serial number. Throws Error(Failed) for a text longer
  /// than kMaxText.
  uint64_t write(const frames::WovenFrame& frame, std::string_view text);
  /// Returns the descriptor to pass on. Others can map it for reading only.
  [[nodiscard]] const std::shared_ptr<const UniqueFd>& descriptor() const { return fd_; }

 private:
  std::shared_ptr<const UniqueFd> fd_;
  uint8_t* bytes_ = nullptr;
  size_t pixels_ = 0;
  uint64_t serial_ = 0;
};

}  // namespace lenticule::player
