// SPDX-License-Identifier: Apache-2.0
// RingMemory is the player's mapping of a ring: a sealed memfd, its header and table writable, its
// slots read-only.
#pragma once

#include <span>

#include "base/unique_fd.h"
#include "frames/ring/mapping.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"

namespace lenticule::frames {

class RingMemory {
 public:
  /// Throws Error(Usage) for a geometry that no ring can have, Error(Failed) when the ring would
  /// need more than half of the free memory or the kernel refuses.
  RingMemory(const RingLayout& layout, RingPrefault prefault);

  [[nodiscard]] const RingLayout& layout() const { return layout_; }
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] RingHeader& header() const;
  [[nodiscard]] std::span<SlotEntry> table() const;
  /// Rewrites the constant fields.
  void restore_header() const { write_header(layout_, header()); }
  /// Returns the whole frame in a slot, with its present bytes.
  [[nodiscard]] FrameView frame(int slot) const;

 private:
  RingLayout layout_;
  UniqueFd fd_;
  Mapping control_;  ///< header and table
  Mapping pixels_;   ///< slots, read-only: the player cannot damage a frame
};

/// Returns the bytes available without swapping, from /proc/meminfo; 0 if unknown.
[[nodiscard]] size_t available_memory();

}  // namespace lenticule::frames
