// SPDX-License-Identifier: Apache-2.0
// Provides small GIFs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::test {

/// Returns a GIF of red pictures of one pixel.
inline std::vector<uint8_t> gif_of(int pictures) {
  using namespace std::string_view_literals;
  std::string gif("GIF89a\1\0\1\0\x80\0\0\xFF\0\0\xFF\xFF\xFF"sv);
  for (int n = 0; n < pictures; ++n)
    gif +=
        "!\xF9\4\0\x0A\0\0\0"
        ",\0\0\0\0\1\0\1\0\0\2\2D\1\0"sv;
  gif += ';';
  return {gif.begin(), gif.end()};
}

}  // namespace lenticule::test
