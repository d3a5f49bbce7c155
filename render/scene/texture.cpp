// SPDX-License-Identifier: Apache-2.0
#include "render/scene/texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "frames/srgb.h"

namespace lenticule::render {
namespace {

/// Two neighbouring texels along one axis and the weight of the second.
struct Neighbours {
  int first = 0;
  int second = 0;
  double blend = 0.0;
};

/// Returns the distance of a coordinate above the next lower integer; beyond 2^52 all doubles are
/// integers. Does not use std::floor, which is a function call without SSE4, since this runs for
/// every shaded point.
double beyond_whole(double coordinate) {
  constexpr double kWhole = 4503599627370496.0;
  if (!(std::abs(coordinate) < kWhole)) return 0.0;
  const double beyond = coordinate - static_cast<double>(static_cast<int64_t>(coordinate));
  return beyond < 0.0 ? beyond + 1.0 : beyond;
}

Neighbours neighbours(double coordinate, int size, bool repeat, bool mirror) {
  if (!std::isfinite(coordinate)) coordinate = 0.0;
  if (mirror) {
    const double in_pair = 2.0 * beyond_whole(coordinate / 2.0);
    coordinate = in_pair > 1.0 ? 2.0 - in_pair : in_pair;
    repeat = false;  // beyond the border lies the border's own mirror image
  }
  // Reduced to the picture first, so that huge coordinates neither overflow nor lose the blend
  // weight.
  coordinate = repeat ? beyond_whole(coordinate) : std::clamp(coordinate, 0.0, 1.0);
  // Measured from half a texel before the first texel, so that the value is at least 0 and
  // truncation rounds down; `first` is one less.
  const double texel = coordinate * size + 0.5;
  const int second = static_cast<int>(texel);
  const int first = second - 1;
  const double blend = texel - second;
  if (repeat) return {first < 0 ? size - 1 : first, second >= size ? 0 : second, blend};
  return {std::max(first, 0), std::min(second, size - 1), blend};
}

/// Interpolates; the result lies between a and b since part < 1.
double blended(double a, double b, double part) { return a + part * (b - a); }

}  // namespace

const std::array<float, 256>& light_of_codes() {
  static const std::array<float, 256> light = [] {
    std::array<float, 256> rounded{};
    for (size_t code = 0; code < rounded.size(); ++code)
      rounded[code] = static_cast<float>(frames::linear_of_codes()[code]);
    return rounded;
  }();
  return light;
}

bool is_complete(const Texture& texture) {
  if (texture.width <= 0 || texture.height <= 0) return false;
  const size_t values =
      4 * static_cast<size_t>(texture.width) * static_cast<size_t>(texture.height);
  return texture.codes.empty() ? texture.rgba.size() == values
                               : texture.codes.size() == values && texture.rgba.empty();
}

double texel_light(const Texture& texture, size_t texel, int channel) {
  const size_t at = texel * 4 + static_cast<size_t>(channel);
  if (texture.codes.empty()) return double{texture.rgba[at]};
  const uint8_t code = texture.codes[at];
  return double{channel == 3 ? static_cast<float>(code) / 255.0F : light_of_codes()[code]};
}

double texture_value(const Texture& texture, double u, double v, int channel) {
  const Neighbours x = neighbours(u, texture.width, texture.repeat_u, texture.mirror_u);
  const Neighbours y = neighbours(v, texture.height, texture.repeat_v, texture.mirror_v);
  const auto texel = [&](int column, int row) {
    const size_t index =
        static_cast<size_t>(row) * static_cast<size_t>(texture.width) + static_cast<size_t>(column);
    return texel_light(texture, index, channel);
  };
  const double top = blended(texel(x.first, y.first), texel(x.second, y.first), x.blend);
  const double bottom = blended(texel(x.first, y.second), texel(x.second, y.second), x.blend);
  return blended(top, bottom, y.blend);
}

bool same_texture(const std::shared_ptr<const Texture>& a,
                  const std::shared_ptr<const Texture>& b) {
  if (a == b) return true;
  return a && b && a->width == b->width && a->height == b->height && a->repeat_u == b->repeat_u &&
         a->repeat_v == b->repeat_v && a->mirror_u == b->mirror_u && a->mirror_v == b->mirror_v &&
         a->rgba == b->rgba && a->codes == b->codes;
}

// ---- texture codes

bool keep_codes(Texture& texture, bool is_colour) {
  if (texture.rgba.empty()) return !texture.codes.empty();
  std::vector<uint8_t> codes(texture.rgba.size());
  for (size_t n = 0; n < codes.size(); ++n) {
    const float value = texture.rgba[n];
    const bool is_light = is_colour && n % 4 != 3;
    codes[n] =
        is_light ? frames::code_from_linear(double{value}) : frames::code_from_encoded(value);
    const float again =
        is_light ? light_of_codes()[codes[n]] : static_cast<float>(codes[n]) / 255.0F;
    if (again != value) return false;
  }
  texture.codes = std::move(codes);
  texture.rgba = std::vector<float>();  // {} would keep the memory
  return true;
}

}  // namespace lenticule::render
