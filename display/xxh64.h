// SPDX-License-Identifier: Apache-2.0
// The 64-bit xxHash (seed 0) of a stream of bytes: fast enough to name every frame of a 4K display,
// and anybody can check the figure with `xxhsum -H1` on the raw RGB bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace lenticule::display {

class Xxh64 {
 public:
  void update(std::span<const uint8_t> bytes) noexcept;
  [[nodiscard]] uint64_t digest() const noexcept;

 private:
  static constexpr size_t kStripe = 32;
  void consume_stripe(const uint8_t* stripe) noexcept;

  std::array<uint64_t, 4> lanes_ = {0x60EA27EEADC0B5D6u, 0xC2B2AE3D27D4EB4Fu, 0u,
                                    0x61C8864E7A143579u};
  std::array<uint8_t, kStripe> pending_{};
  size_t pending_size_ = 0;
  uint64_t total_ = 0;
};

}  // namespace lenticule::display
