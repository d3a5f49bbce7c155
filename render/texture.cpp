// SPDX-License-Identifier: Apache-2.0
#include "render/texture.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {
namespace {

/// Two neighbouring texels of one axis and how much of the second.
struct Neighbours {
  int first = 0;
  int second = 0;
  double blend = 0.0;
};

Neighbours neighbours(double coordinate, int size, bool repeat) {
  if (!std::isfinite(coordinate)) coordinate = 0.0;
  // Brought near the picture first, so that huge coordinates neither overflow nor lose the blend.
  coordinate = repeat ? coordinate - std::floor(coordinate) : std::clamp(coordinate, 0.0, 1.0);
  const double texel = coordinate * size - 0.5;
  const double below = std::floor(texel);
  const int first = static_cast<int>(below);
  const auto wrap = [&](int i) { return repeat ? (i + size) % size : std::clamp(i, 0, size - 1); };
  return {wrap(first), wrap(first + 1), texel - below};
}

}  // namespace

double texture_value(const Texture& texture, double u, double v, int channel) {
  const Neighbours x = neighbours(u, texture.width, texture.repeat_u);
  const Neighbours y = neighbours(v, texture.height, texture.repeat_v);
  const auto texel = [&](int column, int row) {
    const size_t index =
        static_cast<size_t>(row) * static_cast<size_t>(texture.width) + static_cast<size_t>(column);
    return double{texture.rgba[index * 4 + static_cast<size_t>(channel)]};
  };
  const double top = std::lerp(texel(x.first, y.first), texel(x.second, y.first), x.blend);
  const double bottom = std::lerp(texel(x.first, y.second), texel(x.second, y.second), x.blend);
  return std::lerp(top, bottom, y.blend);
}

bool same_texture(const std::shared_ptr<const Texture>& a,
                  const std::shared_ptr<const Texture>& b) {
  if (a == b) return true;
  return a && b && a->width == b->width && a->height == b->height && a->repeat_u == b->repeat_u &&
         a->repeat_v == b->repeat_v && a->rgba == b->rgba;
}

}  // namespace lenticule::render
