// SPDX-License-Identifier: Apache-2.0
#include "display/xxh64.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace lenticule::display {
namespace {

std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

uint64_t hash_of(std::span<const uint8_t> bytes) {
  Xxh64 hash;
  hash.update(bytes);
  return hash.digest();
}

TEST(Xxh64, GivesThePublishedValues) {
  EXPECT_EQ(hash_of({}), 0xEF46DB3751D8E999u);
  EXPECT_EQ(hash_of(bytes_of("a")), 0xD24EC4F1A98C6E5Bu);
  EXPECT_EQ(hash_of(bytes_of("abc")), 0x44BC2CF5AD770999u);
  EXPECT_EQ(hash_of(bytes_of("Nobody inspects the spammish repetition")), 0xFBCEA83C8A378BF1u);
}

TEST(Xxh64, DoesNotDependOnHowTheBytesArrive) {
  std::vector<uint8_t> bytes(517);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(i * 7 + i / 3);
  const uint64_t whole = hash_of(bytes);
  for (size_t step = 1; step < 130; ++step) {
    Xxh64 hash;
    for (size_t i = 0; i < bytes.size(); i += step)
      hash.update(std::span(bytes).subspan(i, std::min(step, bytes.size() - i)));
    ASSERT_EQ(hash.digest(), whole) << "in pieces of " << step;
  }
}

TEST(Xxh64, SeesEveryByte) {
  std::vector<uint8_t> bytes(100);
  const uint64_t before = hash_of(bytes);
  for (uint8_t& byte : bytes) {
    byte ^= 1;
    EXPECT_NE(hash_of(bytes), before);
    byte ^= 1;
  }
}

}  // namespace
}  // namespace lenticule::display
