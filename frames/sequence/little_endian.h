// SPDX-License-Identifier: Apache-2.0
// Reads and writes integers as little-endian bytes, on machines of any byte order.
#pragma once

#include <cstdint>
#include <vector>

namespace lenticule::frames {

[[nodiscard]] inline uint64_t load_little(const uint8_t* from, int bytes) noexcept {
  uint64_t value = 0;
  for (int i = bytes - 1; i >= 0; --i) value = value << 8 | from[i];
  return value;
}
[[nodiscard]] inline uint32_t load_u32(const uint8_t* from) noexcept {
  return static_cast<uint32_t>(load_little(from, 4));
}
[[nodiscard]] inline uint64_t load_u64(const uint8_t* from) noexcept {
  return load_little(from, 8);
}

inline void append_little(std::vector<uint8_t>& to, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<uint8_t>(value >> 8 * i));
}
inline void append_u32(std::vector<uint8_t>& to, uint32_t value) {
  append_little(to, value, 4);
}
inline void append_u64(std::vector<uint8_t>& to, uint64_t value) {
  append_little(to, value, 8);
}

}  // namespace lenticule::frames
