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
#include "frames/ring/slot_ledger.h"

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
void keep_books(std::span<const uint8_t> bytes) {
  constexpr int kSlots = 4;
  std::vector<SlotEntry> table(kSlots);
  SlotLedger ledger(table, bytes.size() % 2 == 0 ? LoopKeeping::Off : LoopKeeping::On);
  std::vector<int> lent;
  bool tenanted = false;
  for (; bytes.size() >= 12; bytes = bytes.subspan(12)) {
    SlotEntry& entry = table[bytes[1] % kSlots];
    uint64_t value = 0;
    std::memcpy(&value, bytes.data() + 4, sizeof value);
    SlotLedger::Frame frame;
    switch (bytes[0] % 9) {
      case 0:
        entry.word = static_cast<uint32_t>(value);
        break;
      case 1:
        entry.word = slot_word(static_cast<SlotState>(value % 5), ledger.epoch());
        break;
      case 2:
        entry.order = value;
        break;
      case 3:
        entry.frame_number = value;
        break;
      case 4:
        if (ledger.pull(frame) == PullStatus::Ready) lent.push_back(frame.slot);
        break;
      case 5:
        if (lent.empty()) break;
        (void)ledger.release(lent.back());
        lent.pop_back();
        break;
      case 6:
        if (!tenanted) ledger.begin_tenancy(value);
        tenanted = true;
        break;
      case 7:
        if (!tenanted) break;
        if (value % 3 == 0) ledger.finish_sequence(value / 3);
        if (value % 3 == 1) ledger.slot_wanted();
        (void)ledger.end_tenancy(value % 2 == 0 ? TenantFate::Dead : TenantFate::MayLive);
        tenanted = false;
        break;
      default:
        (void)ledger.rewind();
        ledger.recover(static_cast<Epoch>(value));
    }
    LENTICULE_CHECK(ledger.lent() == static_cast<int>(lent.size()));
    LENTICULE_CHECK(ledger.lent() <= ledger.max_lent());
    LENTICULE_CHECK(ledger.ready_count() <= kSlots && ledger.shut() >= 0);
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
      lenticule::frames::keep_books(bytes);
  }
  return 0;
}
