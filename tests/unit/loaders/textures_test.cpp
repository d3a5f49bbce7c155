// SPDX-License-Identifier: Apache-2.0
// Tests that textures are decoded once, in advance where possible.
#include "render/loaders/textures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "base/error.h"

namespace lenticule::render {
namespace {

frames::TextureImage pixel(uint8_t code) {
  return {.width = 1, .height = 1, .rgba = {}, .codes = {code, code, code, 255}};
}

TEST(Textures, ThoseOfAListAreDecodedOnceAndAddedInTheOrderOfAdd) {
  SceneDescription listed, scene;
  std::atomic<int> decoded = 0;
  const auto decode = [&decoded](uint8_t code) {
    return [&decoded, code] {
      ++decoded;
      return pixel(code);
    };
  };
  Textures list(listed, Textures::Mode::List);
  for (uint8_t n = 0; n < 20; ++n) (void)list.add({.name = std::to_string(n)}, decode(n));
  (void)list.add({.name = "3"}, decode(3));
  EXPECT_EQ(decoded, 0);
  EXPECT_TRUE(listed.textures.empty());

  Textures textures(scene);
  textures.decode_all(list);
  EXPECT_EQ(decoded, 20);
  EXPECT_TRUE(scene.textures.empty());
  EXPECT_EQ(textures.add({.name = "7"}, decode(100)), 0);
  EXPECT_EQ(textures.add({.name = "3"}, decode(100)), 1);
  EXPECT_EQ(textures.add({.name = "7"}, decode(100)), 0);
  EXPECT_EQ(textures.add({.name = "not listed"}, decode(100)), 2);
  EXPECT_EQ(decoded, 21);
  EXPECT_EQ(scene.textures[0]->codes[0], 7);
  EXPECT_EQ(scene.textures[1]->codes[0], 3);
  EXPECT_EQ(scene.textures[2]->codes[0], 100);
}

TEST(Textures, ADamagedOneOfAListIsNotedWhenItIsAdded) {
  SceneDescription listed, scene;
  const auto damaged = []() -> frames::TextureImage {
    throw Error(ErrorKind::Input, "a.png: damaged");
  };
  Textures list(listed, Textures::Mode::List);
  (void)list.add({.name = "a"}, damaged);
  Textures textures(scene);
  textures.decode_all(list);
  EXPECT_TRUE(scene.notes.empty());
  EXPECT_EQ(textures.add({.name = "a"}, damaged), -1);
  EXPECT_THAT(scene.notes, ::testing::ElementsAre("texture left out: a.png: damaged"));
}

}  // namespace
}  // namespace lenticule::render
