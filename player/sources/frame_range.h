// SPDX-License-Identifier: Apache-2.0
// FrameRange selects frames of a sequence.
#pragma once

#include <cstdint>
#include <string_view>

namespace lenticule::player {

/// Frame numbers [begin, end).
struct FrameRange {
  uint64_t begin = 0;
  uint64_t end = 1;
  [[nodiscard]] uint64_t count() const { return end - begin; }
  /// Returns the part of the range that lies before a frame: 0 for the first, below 1 for the last.
  [[nodiscard]] double part_before(uint64_t frame) const {
    return static_cast<double>(frame - begin) / static_cast<double>(count());
  }
  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

/// Parses "A:B", or "N" for one frame. Throws Error(Usage).
[[nodiscard]] FrameRange parse_frame_range(std::string_view text);

}  // namespace lenticule::player
