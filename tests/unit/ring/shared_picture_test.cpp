// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/shared_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "base/error.h"

namespace lenticule::frames {
namespace {

constexpr int kWidth = 5, kHeight = 3;
constexpr size_t kStride = 8;

std::vector<uint32_t> picture(uint32_t value) {
  std::vector<uint32_t> words(kStride * kHeight, 0xDEADBEEF);
  for (int j = 0; j < kHeight; ++j)
    for (int i = 0; i < kWidth; ++i)
      words[static_cast<size_t>(j) * kStride + static_cast<size_t>(i)] =
          value + static_cast<uint32_t>(j * kWidth + i);
  return words;
}

std::vector<uint32_t> packed(uint32_t value) {
  std::vector<uint32_t> words;
  for (uint32_t n = 0; n < kWidth * kHeight; ++n) words.push_back(value + n);
  return words;
}

TEST(SharedPicture, HasNoneBeforeTheFirst) {
  const SharedPictureWriter writer(kWidth, kHeight);
  SharedPictureReader reader(writer.fd(), kWidth, kHeight);
  std::vector<uint32_t> words;
  EXPECT_FALSE(reader.read(words));
}

TEST(SharedPicture, PassesTheNewestOnce) {
  SharedPictureWriter writer(kWidth, kHeight);
  SharedPictureReader reader(writer.fd(), kWidth, kHeight);
  std::vector<uint32_t> words;
  for (uint32_t number = 1; number < 10; ++number) {
    for (uint32_t missed = 0; missed < number % 4; ++missed)
      writer.publish(picture(99).data(), kStride);
    writer.publish(picture(1000 * number).data(), kStride);
    ASSERT_TRUE(reader.read(words));
    EXPECT_EQ(words, packed(1000 * number));
    EXPECT_FALSE(reader.read(words)) << "the same picture";
  }
}

TEST(SharedPicture, RefusesADescriptorOfASmallerSize) {
  const SharedPictureWriter writer(kWidth, kHeight);
  EXPECT_THROW(SharedPictureReader(writer.fd(), kWidth, 100 * kHeight), Error);
  EXPECT_THROW(SharedPictureReader(-1, kWidth, kHeight), Error);
}

TEST(SharedPicture, NeverMixesTwoPicturesOfABusyWriter) {
  constexpr int kSide = 64;
  constexpr size_t kWords = size_t{kSide} * kSide;
  SharedPictureWriter writer(kSide, kSide);
  SharedPictureReader reader(writer.fd(), kSide, kSide);
  constexpr uint32_t kPictures = 20'000;
  std::atomic<bool> done{false};
  std::thread busy([&] {
    for (uint32_t value = 1; value <= kPictures; ++value)
      writer.publish(std::vector<uint32_t>(kWords, value).data(), kSide);
    done = true;
  });
  std::vector<uint32_t> words;
  uint32_t last = 0;
  for (bool ending = false; !ending;) {
    ending = done;  // read before the attempt, so that the last picture is read in any case
    if (!reader.read(words)) continue;
    EXPECT_EQ(std::count(words.begin(), words.end(), words[0]), ptrdiff_t{kWords});
    EXPECT_GT(words[0], last) << "an older picture";
    last = words[0];
  }
  busy.join();
  EXPECT_EQ(last, kPictures);
}

}  // namespace
}  // namespace lenticule::frames
