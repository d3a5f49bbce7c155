// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

Texture all_codes(bool is_colour) {
  Texture texture{.width = 16, .height = 16};
  for (size_t code = 0; code < 256; ++code) {
    const auto light = static_cast<float>(frames::linear_of_codes()[code]);
    const float share = static_cast<float>(code) / 255.0F;
    for (int c = 0; c < 4; ++c) texture.rgba.push_back(is_colour && c < 3 ? light : share);
  }
  return texture;
}

TEST(TextureCodes, HoldData) {
  Texture data = all_codes(false);
  ASSERT_TRUE(keep_codes(data, false));
  for (size_t n = 0; n < data.codes.size(); ++n) EXPECT_EQ(data.codes[n], n / 4);
}

TEST(TextureCodes, LeaveTexturesOfFinerNumbersAlone) {
  Texture texture = all_codes(true);
  texture.rgba[40] += 1e-3F;
  EXPECT_FALSE(keep_codes(texture, true));
  EXPECT_EQ(texture.rgba.size(), 1024U);
  EXPECT_TRUE(is_complete(texture));
}

}  // namespace
}  // namespace lenticule::render
