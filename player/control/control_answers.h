// SPDX-License-Identifier: Apache-2.0
// FrameMemory and list_json() are what answers of the control socket contain: the displayed frame,
// and a playlist.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/unique_fd.h"
#include "frames/frame.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// FrameMemory shares a copy of the displayed frame with clients of the control socket. All clients
/// share one memory, so that no number of requests takes more.
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
  ~FrameMemory() { ::munmap(bytes_, kPixelsAt + pixels_ + kMaxText); }
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

/// Describes a playlist to clients of the control socket, with the keys of its file: returns
/// {"file", "loop", "default", "count", "first", "items"}: the items from `first` on, at
/// least one if there is one, and more as long as their text is shorter than `most_bytes`.
[[nodiscard]] nlohmann::ordered_json list_json(const Playlist& list, size_t first,
                                               size_t most_bytes = size_t{32} << 10);

}  // namespace lenticule::player
