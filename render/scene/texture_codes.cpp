// SPDX-License-Identifier: Apache-2.0
#include "render/scene/texture_codes.h"

#include <cmath>

#include "frames/srgb.h"

namespace lenticule::render {

bool keep_codes(Texture& texture, bool is_colour) {
  if (texture.rgba.empty()) return !texture.codes.empty();
  std::vector<uint8_t> codes(texture.rgba.size());
  for (size_t n = 0; n < codes.size(); ++n) {
    const float value = texture.rgba[n];
    const bool is_light = is_colour && n % 4 != 3;
    codes[n] =
        is_light ? frames::code_from_linear(double{value}) : frames::code_from_encoded(value);
    const float again = is_light ? static_cast<float>(frames::linear_of_codes()[codes[n]])
                                 : static_cast<float>(codes[n]) / 255.0F;
    if (again != value) return false;
  }
  texture.codes = std::move(codes);
  texture.rgba = std::vector<float>();  // {} would keep the memory
  return true;
}

}  // namespace lenticule::render
