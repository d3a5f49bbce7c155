// SPDX-License-Identifier: Apache-2.0
// LiveValue passes a small struct from one thread to others without a lock (a seqlock).
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace lenticule {

/// Readers get a value that was published as a whole. `Value` consists of 64-bit fields. Thread
/// safety: one thread publishes and never waits; any thread reads.
template <class Value>
class LiveValue {
  static_assert(std::is_trivially_copyable_v<Value> && sizeof(Value) % sizeof(uint64_t) == 0);

 public:
  LiveValue() noexcept { publish(Value{}); }

  void publish(const Value& value) noexcept {
    const auto fields = std::bit_cast<Fields>(value);
    const uint64_t version = version_.load(std::memory_order_relaxed);
    version_.store(version + 1, std::memory_order_seq_cst);
    for (size_t k = 0; k < kFields; ++k) fields_[k].store(fields[k], std::memory_order_seq_cst);
    version_.store(version + 2, std::memory_order_seq_cst);
  }

  [[nodiscard]] Value read() const noexcept {
    Fields fields{};
    uint64_t before = 0;
    do {
      before = version_.load(std::memory_order_seq_cst);
      for (size_t k = 0; k < kFields; ++k) fields[k] = fields_[k].load(std::memory_order_seq_cst);
    } while (before % 2 != 0 || before != version_.load(std::memory_order_seq_cst));
    return std::bit_cast<Value>(fields);
  }

 private:
  static constexpr size_t kFields = sizeof(Value) / sizeof(uint64_t);
  using Fields = std::array<uint64_t, kFields>;

  std::atomic<uint64_t> version_{0};  ///< odd during a write
  std::array<std::atomic<uint64_t>, kFields> fields_{};
};

}  // namespace lenticule
