// SPDX-License-Identifier: Apache-2.0
// SlotEntry is the part of the shared memory that decides which process may access a slot's pixels:
// one 64-byte entry per slot. Both processes access the table only through these functions.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace lenticule::frames {

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
[[nodiscard]] constexpr Epoch next_epoch(Epoch epoch) {
  return epoch == kMaxEpoch ? 1 : epoch + 1;
}

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

}  // namespace lenticule::frames
