// SPDX-License-Identifier: Apache-2.0
// RingLayout describes the shared memory of a ring: one header page, the slot table, the slots.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "frames/frame.h"
#include "frames/ring/slot_entry.h"

namespace lenticule::frames {

inline constexpr uint32_t kRingAbiVersion = 1;
inline constexpr uint32_t kEndianTag = 0x01020304;
inline constexpr char kRingMagic[8] = {'L', 'N', 'T', 'C', 'R', 'I', 'N', 'G'};
inline constexpr size_t kHeaderBytes = 4096;
inline constexpr size_t kPageBytes = 4096;
inline constexpr size_t kHugePageBytes = size_t{2} << 20;
inline constexpr int kMinSlots = 3;  ///< one displayed, one next, one being written
inline constexpr int kMaxSlots = 4096;
inline constexpr int kMaxFrameSide = 32768;

/// RingHeader is the first page of the shared memory. All fields are constant once the memory is
/// shared, except the last two.
struct RingHeader {
  char magic[8];
  uint32_t abi_version;
  uint32_t endian_tag;
  uint32_t slots;
  uint32_t format;  ///< PixelFormat
  uint32_t width;
  uint32_t height;
  uint64_t row_bytes;
  uint64_t frame_bytes;
  uint64_t table_offset;
  uint64_t entry_bytes;
  uint64_t slots_offset;
  uint64_t slot_stride;
  uint64_t memory_bytes;
  alignas(64) std::atomic<uint32_t> epoch;      ///< number of the connection, counted by the player
  alignas(64) std::atomic<uint32_t> heartbeat;  ///< counter that a live renderer increments
};

static_assert(sizeof(RingHeader) <= kHeaderBytes);
static_assert(offsetof(RingHeader, row_bytes) == 32 && offsetof(RingHeader, memory_bytes) == 80);
static_assert(offsetof(RingHeader, epoch) == 128 && offsetof(RingHeader, heartbeat) == 192);

/// RingLayout holds the header's values in plain numbers, as each side's private copy.
struct RingLayout {
  FrameGeometry geometry;
  int slots = 0;
  size_t table_offset = 0;
  size_t slots_offset = 0;
  size_t slot_stride = 0;
  size_t memory_bytes = 0;

  [[nodiscard]] size_t slot_offset(int slot) const {
    return slots_offset + static_cast<size_t>(slot) * slot_stride;
  }
  friend bool operator==(const RingLayout&, const RingLayout&) = default;
};

/// Returns the layout for `slots` frames. Sizes must be within the limits above (see
/// geometry_problem). Frames of 2 MiB and more are aligned to 2 MiB so that the kernel can use huge
/// pages.
[[nodiscard]] RingLayout plan_layout(const FrameGeometry& geometry, int slots);

/// Returns the reason why a ring cannot have this geometry or number of slots; nullptr if it can.
[[nodiscard]] const char* geometry_problem(const FrameGeometry& geometry, int64_t slots);

/// Writes the constant fields; does not change epoch and heartbeat.
void write_header(const RingLayout& layout, RingHeader& header);

/// Reads every constant field once and trusts none: sets `layout` only if this build would have
/// planned exactly the same layout and the layout fits into `available_bytes`. Returns the reason
/// otherwise, nullptr on success.
[[nodiscard]] const char* read_header(const RingHeader& header, size_t available_bytes,
                                      RingLayout& layout);

}  // namespace lenticule::frames
