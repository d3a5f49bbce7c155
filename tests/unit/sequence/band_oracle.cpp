// SPDX-License-Identifier: Apache-2.0
#include "band_oracle.h"

#include <gtest/gtest.h>
#include <zstd.h>

namespace lenticule::test {
namespace {

uint32_t take_number(std::span<const uint8_t>& from) {
  const uint32_t number = from[0] + from[1] * 256u + from[2] * 65536u + from[3] * 16777216u;
  from = from.subspan(4);
  return number;
}

std::vector<uint8_t> take_stream(std::span<const uint8_t>& from, size_t bytes) {
  const uint32_t stored = take_number(from);
  std::vector<uint8_t> stream(from.begin(), from.begin() + stored);
  from = from.subspan(stored);
  if (stored == bytes) return stream;
  std::vector<uint8_t> whole(bytes);
  EXPECT_EQ(ZSTD_decompress(whole.data(), bytes, stream.data(), stored), bytes);
  return whole;
}

}  // namespace

std::vector<uint8_t> oracle_decode_predicted(std::span<const uint8_t> payload, size_t band_bytes) {
  std::vector<uint32_t> distances(1, 0);
  for (uint32_t count = take_number(payload); count > 0; --count)
    distances.push_back(take_number(payload));
  const std::vector<uint8_t> modes = take_stream(payload, (band_bytes + 31) / 32);
  size_t masked = 0;
  for (const uint8_t mode : modes) masked += mode >= 16 ? 1 : 0;
  const std::vector<uint8_t> masks = take_stream(payload, 4 * masked);
  size_t bits = 0;
  for (const uint8_t byte : masks) {
    for (int bit = 0; bit < 8; ++bit) bits += static_cast<size_t>(byte >> bit & 1);
  }
  const std::vector<uint8_t> values = take_stream(payload, bits);
  EXPECT_TRUE(payload.empty());

  std::vector<uint8_t> band(band_bytes);
  size_t block = 0;  // index among the blocks with a mask
  size_t value = 0;
  for (size_t i = 0; i < band_bytes; ++i) {
    const uint8_t mode = modes[i / 32];
    const uint32_t distance = distances.at(mode % 16);
    int sum = distance == 0 ? 0 : band.at(i - distance);
    if (mode >= 16 && (masks[4 * block + i % 32 / 8] >> i % 8 & 1) != 0) sum += values.at(value++);
    band[i] = static_cast<uint8_t>(sum);
    if (i % 32 == 31 && mode >= 16) ++block;
  }
  EXPECT_EQ(value, values.size());
  return band;
}

}  // namespace lenticule::test
