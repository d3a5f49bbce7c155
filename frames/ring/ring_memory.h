// SPDX-License-Identifier: Apache-2.0
// The player's memory of a ring: a sealed memfd, its header and table writable, its slots only
// readable.
#pragma once

#include <span>

#include "base/unique_fd.h"
#include "frames/ring/mapping.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_player.h"

namespace lenticule::frames {

class RingMemory {
 public:
  /// Throws Error(Usage) for a geometry that no ring has, Error(Failed) when the ring would take
  /// more than half of the free memory or the kernel refuses.
  RingMemory(const RingLayout& layout, RingPrefault prefault);

  [[nodiscard]] const RingLayout& layout() const { return layout_; }
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] RingHeader& header() const;
  [[nodiscard]] std::span<SlotEntry> table() const;
  /// Writes the constant fields anew.
  void restore_header() const { write_header(layout_, header()); }
  /// The whole frame in a slot, as it lies there now.
  [[nodiscard]] FrameView frame(int slot) const;

 private:
  RingLayout layout_;
  UniqueFd fd_;
  Mapping control_;  ///< header and table
  Mapping pixels_;   ///< slots, read-only: the player cannot spoil a frame
};

/// Bytes that could be had without swapping, as /proc/meminfo says; 0 if it does not.
[[nodiscard]] size_t available_memory();

}  // namespace lenticule::frames
