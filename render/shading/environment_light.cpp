// SPDX-License-Identifier: Apache-2.0
#include "render/shading/environment_light.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/rays/primary_rays.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSourceSize = 256;
/// Rays per texel of the source's map, along each side.
constexpr int kRaysPerSide = 2;
/// Angle of the light that a mirror shows at a point.
constexpr double kSharp = 0.003;
constexpr int kDiffuseSize = 32;

/// Returns the point of the octahedron |x| + |y| + |z| = 1 at a place of its unfolded square.
Vec3 octahedron_at(Vec2 place) {
  const double x = 2.0 * place.x - 1.0, z = 2.0 * place.y - 1.0;
  const double y = 1.0 - std::abs(x) - std::abs(z);
  if (y >= 0.0) return {x, y, z};
  return {std::copysign(1.0 - std::abs(z), x), y, std::copysign(1.0 - std::abs(x), z)};
}

Vec2 place_of(Vec3 direction) {
  const double sum = std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z);
  double x = direction.x / sum, z = direction.z / sum;
  if (direction.y < 0.0) {
    const double folded = std::copysign(1.0 - std::abs(z), x);
    z = std::copysign(1.0 - std::abs(x), z);
    x = folded;
  }
  return {0.5 + 0.5 * x, 0.5 + 0.5 * z};
}

Vec2 middle(int x, int y, int size) { return {(x + 0.5) / size, (y + 0.5) / size}; }

/// Size of the map for a roughness: some texels across the lobe.
int size_for(double roughness) { return roughness < 0.2 ? 128 : roughness < 0.3 ? 64 : 32; }

/// Sample of the lobe around the z axis: its direction, its weight, and the map from which it is
/// taken.
struct LobeSample {
  Vec3 direction;
  double weight;
  size_t map;
};

/// Takes each sample from the map whose texels are about as large as the sample (Krivanek and
/// Colbert, "Real-time Shading with Filtered Importance Sampling", 2008).
std::vector<LobeSample> lobe_samples(double alpha, size_t maps) {
  const unsigned count = alpha < 0.1 ? 64 : 256;
  const double texel_angle = 4.0 * kPi / (kSourceSize * kSourceSize);
  std::vector<LobeSample> samples;
  for (unsigned n = 0; n < count; ++n) {
    // Microfacet normals with the density of GGX times the cosine.
    const double u = (n + 0.5) / count, turn = 2.0 * kPi * radical_inverse(n);
    const double cos_squared = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
    const double light_cosine = 2.0 * cos_squared - 1.0;
    if (light_cosine <= 0.0) continue;
    const double across = 2.0 * std::sqrt(cos_squared * (1.0 - cos_squared));
    const double spread = cos_squared * (alpha * alpha - 1.0) + 1.0;
    const double density = alpha * alpha / (kPi * spread * spread) / 4.0;  // of the mirrored ray
    const double level = 0.5 * std::log2(1.0 / (count * density * texel_angle));
    const double last = static_cast<double>(maps) - 1.0;
    samples.push_back({{across * std::cos(turn), across * std::sin(turn), light_cosine},
                       light_cosine,
                       static_cast<size_t>(std::clamp(level + 0.5, 0.0, last))});
  }
  return samples;
}

}  // namespace

EnvironmentLight::Map::Map(int side)
    : size(side), texels(static_cast<size_t>((side + 2) * (side + 2) + 1)) {}

template <class Value>
EnvironmentLight::Map::Map(int side, const Value& value) : Map(side) {
  tbb::parallel_for(0, side, [&](int y) {
    for (int x = 0; x < side; ++x) texel(x, y) = Vec3f(value(x, y));
  });
  set_border();
}

void EnvironmentLight::Map::set_border() {
  const int last = size - 1;
  for (int k = 0; k < size; ++k) {
    texel(k, -1) = texel(last - k, 0);
    texel(k, size) = texel(last - k, last);
    texel(-1, k) = texel(0, last - k);
    texel(size, k) = texel(last, last - k);
  }
  texel(-1, -1) = texel(last, last);
  texel(size, size) = texel(0, 0);
  texel(size, -1) = texel(0, last);
  texel(-1, size) = texel(last, 0);
}

Vec3 EnvironmentLight::Map::at(Vec2 place) const {
  // Measured from the border's texel, so that truncation rounds down.
  const double column = place.x * size + 0.5, row = place.y * size + 0.5;
  const int x = std::min(static_cast<int>(column), size), y = std::min(static_cast<int>(row), size);
  const double s = column - x, t = row - y;
  const auto value = [this](int i, int k) { return Vec3(texel(i - 1, k - 1)); };
  return (value(x, y) * (1.0 - s) + value(x + 1, y) * s) * (1.0 - t) +
         (value(x, y + 1) * (1.0 - s) + value(x + 1, y + 1) * s) * t;
}

EnvironmentLight::Map EnvironmentLight::Map::halved() const {
  return Map(size / 2, [this](int x, int y) {
    return (texel(2 * x, 2 * y) + texel(2 * x + 1, 2 * y) + texel(2 * x, 2 * y + 1) +
            texel(2 * x + 1, 2 * y + 1)) *
           0.25F;
  });
}

EnvironmentLight::Map EnvironmentLight::filtered(const std::vector<Map>& light, double roughness) {
  const std::vector<LobeSample> lobe = lobe_samples(roughness * roughness, light.size());
  const int size = size_for(roughness);
  return Map(size, [&](int x, int y) {
    const Vec3 ahead = normalized(octahedron_at(middle(x, y, size)));
    const Vec3 aside =
        normalized(cross(std::abs(ahead.y) < 0.9 ? Vec3{0, 1, 0} : Vec3{1, 0, 0}, ahead));
    const Vec3 above = cross(ahead, aside);
    Vec3 sum;
    double weights = 0.0;
    for (const LobeSample& sample : lobe) {
      const Vec3 direction =
          aside * sample.direction.x + above * sample.direction.y + ahead * sample.direction.z;
      sum += light[sample.map].at(place_of(direction)) * sample.weight;
      weights += sample.weight;
    }
    return sum / weights;
  });
}

EnvironmentLight::Map EnvironmentLight::cosine_filtered(const Map& light) {
  struct Part {
    Vec3 direction;
    Vec3 light;  ///< times the solid angle
    double angle;
  };
  std::vector<Part> parts;
  for (int y = 0; y < light.size; ++y)
    for (int x = 0; x < light.size; ++x) {
      const Vec3 at = octahedron_at(middle(x, y, light.size));
      const double distance = length(at);
      const double angle = 1.0 / (distance * distance * distance);
      parts.push_back({at / distance, Vec3(light.texel(x, y)) * angle, angle});
    }
  return Map(kDiffuseSize, [&](int x, int y) {
    const Vec3 normal = normalized(octahedron_at(middle(x, y, kDiffuseSize)));
    Vec3 sum;
    double weights = 0.0;
    for (const Part& part : parts) {
      const double cosine = std::max(0.0, dot(normal, part.direction));
      sum += part.light * cosine;
      weights += part.angle * cosine;
    }
    return sum / weights;
  });
}

EnvironmentLight::EnvironmentLight(Vec3 uniform) : uniform_(uniform) {}

EnvironmentLight::EnvironmentLight(Source source) : source_(std::move(source)) {
  constexpr int kRays = kRaysPerSide * kSourceSize;
  const double angle = std::sqrt(4.0 * kPi) / kRays;
  std::vector<Map> light{Map(kSourceSize, [&](int x, int y) {
    Vec3 sum;
    for (int j = 0; j < kRaysPerSide; ++j)
      for (int i = 0; i < kRaysPerSide; ++i)
        sum += source_(
            normalized(octahedron_at(middle(kRaysPerSide * x + i, kRaysPerSide * y + j, kRays))),
            angle);
    return sum / (kRaysPerSide * kRaysPerSide);
  })};
  while (light.back().size > 4) light.push_back(light.back().halved());
  const auto coarse =
      std::ranges::find_if(light, [](const Map& m) { return m.size <= kDiffuseSize; });
  diffuse_ = cosine_filtered(*coarse);
  for (int n = 1; n < kMaps; ++n)
    maps_.push_back(filtered(light, static_cast<double>(n) / (kMaps - 1)));
}

Vec3 EnvironmentLight::mirrored(Vec3 direction, double roughness) const {
  if (!source_) return uniform_;
  const double place = std::clamp(roughness, 0.0, 1.0) * (kMaps - 1);
  const int below = std::min(static_cast<int>(place), kMaps - 2);
  const double part = place - below;
  const Vec2 at = place_of(direction);
  const auto map = [&](int n) {
    return n == 0 ? source(direction) : maps_[static_cast<size_t>(n - 1)].at(at);
  };
  if (part == 0.0) return map(below);
  return map(below) * (1.0 - part) + map(below + 1) * part;
}

Vec3 EnvironmentLight::diffuse(Vec3 normal) const {
  return source_ ? diffuse_.at(place_of(normal)) : uniform_;
}

Vec3 EnvironmentLight::source(Vec3 direction) const {
  return source_ ? source_(direction, kSharp) : uniform_;
}

pbr_kernel::Environment EnvironmentLight::tables() const {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  const auto table = [](const Map& map) {
    return pbr_kernel::Map{.texels = &map.texels.data()->x, .size = map.size};
  };
  pbr_kernel::Environment out{};
  out.is_uniform = source_ ? 0 : -1;
  write(uniform_, out.uniform);
  if (!source_) return out;
  out.diffuse = table(diffuse_);
  for (size_t n = 0; n < maps_.size(); ++n) out.mirrored[n] = table(maps_[n]);
  return out;
}

}  // namespace lenticule::render
