// SPDX-License-Identifier: Apache-2.0
// RingLayout describes the shared memory of a ring: one header page, the slot table, the slots.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "frames/frame.h"

namespace lenticule::frames {

class Mapping {
 public:
  Mapping() = default;
  /// Maps `bytes` of `fd` from `offset` on, shared; empty when the kernel refuses (see errno).
  /// The offset need not be on a page: pages have up to 64 KiB on ARM, and a ring aligns small
  /// frames to 4 KiB. Children do not inherit the mapping, because they could outlive their
  /// parent's connection. Core dumps exclude the mapping, because its pictures would add gigabytes.
  Mapping(int fd, size_t offset, size_t bytes, int protection) {
    const size_t before = offset % page_bytes();
    void* start = ::mmap(nullptr, before + bytes, protection, MAP_SHARED, fd,
                         static_cast<off_t>(offset - before));
    if (start == MAP_FAILED) return;
    bytes_ = {static_cast<uint8_t*>(start) + before, bytes};
    ::madvise(start, before + bytes, MADV_DONTFORK);
    ::madvise(start, before + bytes, MADV_DONTDUMP);
  }
  Mapping(Mapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  Mapping& operator=(Mapping&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Mapping() {
    if (bytes_.empty()) return;
    const size_t before = reinterpret_cast<uintptr_t>(bytes_.data()) % page_bytes();
    ::munmap(bytes_.data() - before, before + bytes_.size());
  }

  explicit operator bool() const { return !bytes_.empty(); }
  [[nodiscard]] std::span<uint8_t> bytes() const { return bytes_; }

 private:
  static size_t page_bytes() { return static_cast<size_t>(::sysconf(_SC_PAGESIZE)); }

  std::span<uint8_t> bytes_;
};

/// Returns the number of a video's frame in the ring. Positions grow through all loops; a frame
/// stays until the position of the next one. The lowest bit marks the clip's first frame. (A ring
/// accepts numbers up to 2^48, which last 70,000 years.)
[[nodiscard]] constexpr uint64_t ring_number(uint64_t position, bool begins_clip) {
  return position << 1 | (begins_clip ? 1 : 0);
}
[[nodiscard]] constexpr uint64_t position_of(uint64_t number) { return number >> 1; }
[[nodiscard]] constexpr bool begins_clip(uint64_t number) { return (number & 1) != 0; }

/// Longest time that a frame of a video stays.
inline constexpr double kLongestFrameSeconds = 3600.0;

// SlotEntry is the part of the shared memory that decides which process may access a slot's pixels:
// one 64-byte entry per slot. Both processes access the table only through these functions.

/// SlotState is the state of a slot. The renderer makes the transitions Free -> Writing -> Ready,
/// the player Ready -> Showing -> Free. Zero is not a state, so that a page removed from the memory
/// (hole punching) is detected.
enum class SlotState : uint32_t { Free = 1, Writing = 2, Ready = 3, Showing = 4 };

/// Epoch is a connection's number. It is part of the word that a state change compares, so that a
/// renderer of an earlier connection cannot change a slot that was offered to a later connection.
using Epoch = uint32_t;

inline constexpr uint32_t kStateBits = 3;
inline constexpr Epoch kMaxEpoch = UINT32_MAX >> kStateBits;

[[nodiscard]] constexpr uint32_t slot_word(SlotState state, Epoch epoch) {
  return epoch << kStateBits | static_cast<uint32_t>(state);
}

/// Returns the next epoch; after 2^29 connections the numbers start again at 1.
[[nodiscard]] constexpr Epoch next_epoch(Epoch epoch) { return epoch == kMaxEpoch ? 1 : epoch + 1; }

struct alignas(64) SlotEntry {
  std::atomic<uint32_t> word;          ///< slot_word(); its release/acquire orders the pixels too
  uint32_t reserved;                   ///< 0
  std::atomic<uint64_t> frame_number;  ///< position in the sequence
  std::atomic<uint64_t> order;  ///< number of frames that this connection had published before
};

static_assert(sizeof(SlotEntry) == 64 && alignof(SlotEntry) == 64);
static_assert(offsetof(SlotEntry, frame_number) == 8 && offsetof(SlotEntry, order) == 16);
static_assert(std::atomic<uint32_t>::is_always_lock_free);
static_assert(std::atomic<uint64_t>::is_always_lock_free);

/// Takes the slot for writing, in the renderer, if it is free in this epoch. The acquire order
/// ensures that the player has finished reading the pixels.
[[nodiscard]] inline bool take_free_slot(SlotEntry& entry, Epoch epoch) noexcept {
  uint32_t expected = slot_word(SlotState::Free, epoch);
  return entry.word.compare_exchange_strong(expected, slot_word(SlotState::Writing, epoch),
                                            std::memory_order_acquire, std::memory_order_relaxed);
}

/// Publishes the written slot, in the renderer. Returns false when the slot no longer belongs to
/// this connection.
[[nodiscard]] inline bool publish_slot(SlotEntry& entry, Epoch epoch, uint64_t frame_number,
                                       uint64_t order) noexcept {
  entry.frame_number.store(frame_number, std::memory_order_relaxed);
  entry.order.store(order, std::memory_order_relaxed);
  uint32_t expected = slot_word(SlotState::Writing, epoch);
  return entry.word.compare_exchange_strong(expected, slot_word(SlotState::Ready, epoch),
                                            std::memory_order_release, std::memory_order_relaxed);
}

/// Releases the slot without a frame, in the renderer.
inline void abandon_slot(SlotEntry& entry, Epoch epoch) noexcept {
  uint32_t expected = slot_word(SlotState::Writing, epoch);
  (void)entry.word.compare_exchange_strong(expected, slot_word(SlotState::Free, epoch),
                                           std::memory_order_release, std::memory_order_relaxed);
}

inline constexpr uint32_t kRingAbiVersion = 1;
inline constexpr uint32_t kEndianTag = 0x01020304;
inline constexpr char kRingMagic[8] = {'L', 'N', 'T', 'C', 'R', 'I', 'N', 'G'};
inline constexpr size_t kHeaderBytes = 4096;
inline constexpr size_t kPageBytes = 4096;
inline constexpr size_t kHugePageBytes = size_t{2} << 20;
inline constexpr int kMinSlots = 3;  ///< one displayed, one next, one being written
inline constexpr int kMaxSlots = 4096;
inline constexpr int kMaxFrameSide = 32768;

/// RingRect is a part of a picture, in pixels from its top left corner.
struct RingRect {
  uint16_t left = 0;
  uint16_t top = 0;
  uint16_t width = 0;
  uint16_t height = 0;
  friend bool operator==(const RingRect&, const RingRect&) = default;
};

/// RingContent says what the player expects in a picture. It has the form that it has in the
/// header.
struct RingContent {
  enum Kind : uint32_t {
    Woven = 0,   ///< a frame of the panel; all other members are 0
    Quilt = 1,   ///< views of one size
    Colours = 2  ///< one view with its depth
  };
  uint32_t kind = Woven;
  uint16_t columns = 0, rows = 0, views = 0;  ///< tiles of a quilt
  uint16_t rightmost_first = 0;               ///< 1: tile 0 is that of the rightmost camera
  uint32_t reserved = 0;
  double aspect = 0.0;  ///< width / height of a view as it is displayed; 0: that of its pixels
  RingRect colours{}, depth{};

  friend bool operator==(const RingContent&, const RingContent&) = default;
};
static_assert(sizeof(RingContent) == 40);

/// Returns the place of view `view` (0: leftmost camera) in a picture; for a view with its depth,
/// of the colours (0) or the depth (1).
[[nodiscard]] RingRect place_of_view(const FrameGeometry& picture, const RingContent& content,
                                     int view);
/// Returns the number of such places; 0 for woven frames.
[[nodiscard]] inline int places_in(const RingContent& content) {
  return content.kind == RingContent::Quilt ? content.views
                                            : 2 * static_cast<int>(content.kind / 2);
}

/// RingFields is the constant part of the header, in a form to be copied at once out of memory that
/// other processes can write.
struct RingFields {
  char magic[8];
  uint32_t abi_version, endian_tag, slots;
  uint32_t format;  ///< PixelFormat
  uint32_t width, height;
  uint64_t row_bytes, frame_bytes, table_offset, entry_bytes, slots_offset, slot_stride,
      memory_bytes;
  RingContent content;  ///< renderers of earlier versions do not read it
};

/// RingHeader is the first page of the shared memory.
struct RingHeader : RingFields {
  alignas(64) std::atomic<uint32_t> epoch;      ///< number of the connection, counted by the player
  alignas(64) std::atomic<uint32_t> heartbeat;  ///< counter that a live renderer increments
};

static_assert(sizeof(RingHeader) <= kHeaderBytes && sizeof(RingFields) == 128);
static_assert(offsetof(RingFields, row_bytes) == 32 && offsetof(RingFields, memory_bytes) == 80);
static_assert(offsetof(RingFields, content) == 88);

/// RingLayout holds the header's values in plain numbers, as each side's private copy.
struct RingLayout {
  FrameGeometry geometry;
  int slots = 0;
  size_t table_offset = 0;
  size_t slots_offset = 0;
  size_t slot_stride = 0;
  size_t memory_bytes = 0;
  RingContent content{};

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
