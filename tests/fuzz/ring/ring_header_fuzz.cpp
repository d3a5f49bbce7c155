// SPDX-License-Identifier: Apache-2.0
// Tests all input from a peer: handshake messages, the header of the memory, the slot table. The
// first byte chooses one of them.
#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "base/error.h"
#include "frames/ring/ring_layout.h"
#include "frames/ring/ring_protocol.h"
#include "frames/ring/slot_table.h"

namespace lenticule::frames {
namespace {

void read_messages(std::span<const uint8_t> bytes) {
  RendererHello hello;
  if (read_hello(bytes, hello) == nullptr) {
    LENTICULE_CHECK(hello.name.size() < 64 && hello.rig_fingerprint.size() < 128);
    const HelloMessage again = make_hello(hello);  // an accepted message can be sent
    RendererHello same;
    LENTICULE_CHECK(read_hello({reinterpret_cast<const uint8_t*>(&again), sizeof again}, same) ==
                    nullptr);
    LENTICULE_CHECK(same.name == hello.name && same.rate == hello.rate &&
                    same.frame_count == hello.frame_count);
  }
  AcceptMessage accept;
  if (read_accept(bytes, accept) == nullptr) LENTICULE_CHECK(accept.epoch != 0);
  RefuseReason reason{};
  std::string text;
  (void)read_refuse(bytes, reason, text);
  uint64_t published = 0;
  (void)read_goodbye(bytes, published);
}

void read_memory_header(std::span<const uint8_t> bytes) {
  auto header = std::make_unique<RingHeader>();
  std::memcpy(static_cast<void*>(header.get()), bytes.data(),
              std::min(bytes.size(), sizeof(RingHeader)));
  RingLayout layout;
  constexpr size_t kAvailable = size_t{1} << 30;
  if (read_header(*header, kAvailable, layout) != nullptr) return;
  LENTICULE_CHECK(layout.slots >= kMinSlots && layout.slots <= kMaxSlots);
  LENTICULE_CHECK(layout.slot_offset(layout.slots) <= kAvailable);
  LENTICULE_CHECK(layout.geometry.frame_bytes() <= layout.slot_stride);
  LENTICULE_CHECK(layout.table_offset + layout.slots * sizeof(SlotEntry) <= layout.slots_offset);
}

/// Applies actions of twelve bytes each: kind, slot, and the value written there. The slot table
/// must stay consistent for any bytes.
void run_slot_table(std::span<const uint8_t> bytes) {
  constexpr int kSlots = 4;
  std::vector<SlotEntry> table(kSlots);
  SlotTable slot_table(table, bytes.size() % 2 == 0 ? LoopKeeping::Off : LoopKeeping::On);
  std::vector<int> acquired;
  bool connected = false;
  for (; bytes.size() >= 12; bytes = bytes.subspan(12)) {
    SlotEntry& entry = table[bytes[1] % kSlots];
    uint64_t value = 0;
    std::memcpy(&value, bytes.data() + 4, sizeof value);
    SlotTable::Frame frame;
    switch (bytes[0] % 9) {
      case 0:
        entry.word = static_cast<uint32_t>(value);
        break;
      case 1:
        entry.word = slot_word(static_cast<SlotState>(value % 5), slot_table.epoch());
        break;
      case 2:
        entry.order = value;
        break;
      case 3:
        entry.frame_number = value;
        break;
      case 4:
        if (slot_table.pull(frame) == PullStatus::Ready) acquired.push_back(frame.slot);
        break;
      case 5:
        if (acquired.empty()) break;
        (void)slot_table.release(acquired.back());
        acquired.pop_back();
        break;
      case 6:
        if (!connected) slot_table.begin_connection(value);
        connected = true;
        break;
      case 7:
        if (!connected) break;
        if (value % 3 == 0) slot_table.finish_sequence(value / 3);
        if (value % 3 == 1) slot_table.slot_wanted();
        (void)slot_table.end_connection(value % 2 == 0 ? RendererFate::Dead
                                                       : RendererFate::MayLive);
        connected = false;
        break;
      default:
        (void)slot_table.rewind();
        slot_table.recover(static_cast<Epoch>(value));
    }
    LENTICULE_CHECK(slot_table.acquired() == static_cast<int>(acquired.size()));
    LENTICULE_CHECK(slot_table.acquired() <= slot_table.max_acquired());
    LENTICULE_CHECK(slot_table.ready_count() <= kSlots && slot_table.shut() >= 0);
  }
}

}  // namespace
}  // namespace lenticule::frames

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> bytes(data + 1, size - 1);
  switch (data[0] % 3) {
    case 0:
      lenticule::frames::read_messages(bytes);
      break;
    case 1:
      lenticule::frames::read_memory_header(bytes);
      break;
    default:
      lenticule::frames::run_slot_table(bytes);
  }
  return 0;
}
