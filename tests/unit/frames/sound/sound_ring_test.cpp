// SPDX-License-Identifier: Apache-2.0
#include "frames/sound/sound_ring.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <limits>
#include <thread>
#include <vector>

namespace lenticule::frames {
namespace {

UniqueFd copy_of(int fd) { return UniqueFd(::dup(fd)); }

TEST(SoundRing, GivesEverySampleOnceAndInOrderBetweenTwoThreads) {
  constexpr uint64_t kCount = 5 * SoundRing::kFrames + 77;
  // One mapping for both, because the thread sanitizer knows memory by its address.
  SoundRing ring;
  SoundRing &player = ring, &decoder = ring;
  std::thread writer([&] {
    std::vector<SoundRing::Frame> piece;
    for (uint64_t next = 0; next < kCount;) {
      piece.clear();
      const uint64_t end = std::min({next + decoder.room(), next + 1000, kCount});
      for (; next < end; ++next)
        piece.push_back({static_cast<float>(next % 65521), -static_cast<float>(next % 65521)});
      decoder.write(piece);
      if (piece.empty()) std::this_thread::yield();
    }
  });
  for (uint64_t next = 0; next < kCount;) {
    const uint64_t end = player.look();
    for (; next < end; ++next) {
      ASSERT_TRUE(player.holds(next)) << next;
      ASSERT_EQ(player.at(next)[0], static_cast<float>(next % 65521));
      ASSERT_EQ(player.at(next)[1], -static_cast<float>(next % 65521));
    }
    player.play_from(next);
    std::this_thread::yield();
  }
  writer.join();
}

TEST(SoundRing, KeepsWhatLiesAShortWhileBack) {
  SoundRing player;
  SoundRing decoder(copy_of(player.fd()));
  decoder.write(std::vector<SoundRing::Frame>(SoundRing::kFrames, {0.5F, 0.5F}));
  EXPECT_EQ(decoder.room(), 0U);
  EXPECT_EQ(player.look(), SoundRing::kFrames);
  player.play_from(40'000);
  EXPECT_EQ(decoder.room(), 40'000 - SoundRing::kHistory);
  EXPECT_TRUE(player.holds(40'000 - SoundRing::kHistory));
  EXPECT_TRUE(player.is_gone(40'000 - SoundRing::kHistory - 1));
  player.play_from(30'000);  // a step back does not take anything back
  EXPECT_EQ(decoder.room(), 40'000 - SoundRing::kHistory);
}

TEST(SoundRing, ADecoderThatLiesGetsTheReaderNoFurtherThanTheRing) {
  SoundRing player;
  const Mapping memory(player.fd(), 0, 4096, PROT_READ | PROT_WRITE);
  auto* const written = reinterpret_cast<std::atomic<uint64_t>*>(memory.bytes().data());
  written->store(1000);
  EXPECT_EQ(player.look(), 1000U);
  written->store(3);
  EXPECT_EQ(player.look(), 1000U) << "goes back";
  written->store(std::numeric_limits<uint64_t>::max());
  EXPECT_EQ(player.look(), SoundRing::kFrames) << "is ahead of what the ring holds";
  player.play_from(std::numeric_limits<uint64_t>::max());
  EXPECT_LE(player.look(), 2 * SoundRing::kFrames);
  player.set_round(std::numeric_limits<uint64_t>::max());
  EXPECT_EQ(player.round(), SoundRing::kMost) << "a product with rounds stays a number of frames";
}

TEST(SoundRing, RefusesMemoryOfAnotherSizeAndCannotBeMadeShorter) {
  const SoundRing player;
  UniqueFd other(::memfd_create("other", MFD_CLOEXEC));
  ASSERT_EQ(::ftruncate(other.get(), 4096), 0);
  EXPECT_THROW(SoundRing(std::move(other)), Error);
  EXPECT_NE(::ftruncate(player.fd(), 0), 0);
}

}  // namespace
}  // namespace lenticule::frames
