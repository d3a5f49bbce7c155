// SPDX-License-Identifier: Apache-2.0
#include "render/shading/environment_light.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::render {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSourceWidth = 512;
/// Rays per texel of the source's map, along each side.
constexpr int kRaysPerSide = 2;
/// Angle of the light that a mirror shows at a point.
constexpr double kSharp = 0.003;
constexpr int kDiffuseWidth = 64;
constexpr unsigned kSamples = 128;

Vec3 direction_at(double u, double v) {
  const double azimuth = (u - 0.5) * 2.0 * kPi, from_up = v * kPi;
  const double across = std::sin(from_up);
  return {across * std::sin(azimuth), std::cos(from_up), -across * std::cos(azimuth)};
}

/// Returns the place of a direction in a map.
Vec2 place_of(Vec3 direction) {
  return {0.5 + std::atan2(direction.x, -direction.z) / (2.0 * kPi),
          std::acos(std::clamp(direction.y, -1.0, 1.0)) / kPi};
}

/// Returns the radical inverse of i in base 2.
double radical_inverse(unsigned i) {
  double value = 0.0;
  for (double digit = 0.5; i != 0; i >>= 1, digit *= 0.5)
    if (i & 1U) value += digit;
  return value;
}

/// Width of the map for a roughness: about four texels across the lobe.
int width_for(double roughness) {
  return roughness < 0.2 ? 256 : roughness < 0.3 ? 128 : 64;
}

/// Sample of the lobe around the z axis: its direction, weight, and solid angle.
struct LobeSample {
  Vec3 direction;
  double weight;
  double solid_angle;
};

std::vector<LobeSample> lobe_samples(double alpha) {
  std::vector<LobeSample> samples;
  for (unsigned n = 0; n < kSamples; ++n) {
    // Microfacet normals with the density of GGX times the cosine.
    const double u = (n + 0.5) / kSamples, turn = 2.0 * kPi * radical_inverse(n);
    const double cos_squared = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
    const double z = std::sqrt(cos_squared), across = std::sqrt(1.0 - cos_squared);
    const double light_cosine = 2.0 * cos_squared - 1.0;
    if (light_cosine <= 0.0) continue;
    const double spread = cos_squared * (alpha * alpha - 1.0) + 1.0;
    const double density = alpha * alpha / (kPi * spread * spread) / 4.0;  // of the mirrored ray
    samples.push_back(
        {{2.0 * z * across * std::cos(turn), 2.0 * z * across * std::sin(turn), light_cosine},
         light_cosine,
         1.0 / (kSamples * density)});
  }
  return samples;
}

}  // namespace

Vec3 EnvironmentLight::Map::direction(int x, int y) const {
  return direction_at((x + 0.5) / width, (y + 0.5) / height);
}

Vec3 EnvironmentLight::Map::at(Vec2 place) const {
  const double column = place.x * width - 0.5;
  const double row = std::clamp(place.y * height - 0.5, 0.0, height - 1.0);
  const double left = std::floor(column), above = std::floor(row);
  const int x0 = (static_cast<int>(left) % width + width) % width, x1 = (x0 + 1) % width;
  const int y0 = static_cast<int>(above), y1 = std::min(y0 + 1, height - 1);
  const auto texel = [this](int x, int y) {
    return Vec3(
        texels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]);
  };
  const double s = column - left, t = row - above;
  return (texel(x0, y0) * (1.0 - s) + texel(x1, y0) * s) * (1.0 - t) +
         (texel(x0, y1) * (1.0 - s) + texel(x1, y1) * s) * t;
}

EnvironmentLight::Map EnvironmentLight::Map::halved() const {
  Map half{.width = width / 2, .height = height / 2};
  for (int y = 0; y < half.height; ++y)
    for (int x = 0; x < half.width; ++x) {
      Vec3 sum;
      for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i)
          sum += Vec3(texels[static_cast<size_t>((2 * y + j) * width + 2 * x + i)]) * 0.25;
      half.texels.emplace_back(sum);
    }
  return half;
}

/// Takes each sample from the copy of the map whose texels are about as large as the sample
/// (Krivanek and Colbert, "Real-time Shading with Filtered Importance Sampling", 2008).
EnvironmentLight::Map EnvironmentLight::filtered(const std::vector<Map>& light, double roughness) {
  const std::vector<LobeSample> lobe = lobe_samples(roughness * roughness);
  const double texel_angle =
      2.0 * kPi * kPi / (static_cast<double>(light[0].width) * light[0].height);
  Map map{.width = width_for(roughness), .height = width_for(roughness) / 2};
  map.texels.resize(static_cast<size_t>(map.width) * static_cast<size_t>(map.height));
  tbb::parallel_for(0, map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      const Vec3 ahead = map.direction(x, y);
      const Vec3 aside =
          normalized(cross(std::abs(ahead.y) < 0.9 ? Vec3{0, 1, 0} : Vec3{1, 0, 0}, ahead));
      const Vec3 above = cross(ahead, aside);
      Vec3 sum;
      double weights = 0.0;
      for (const LobeSample& sample : lobe) {
        const Vec3 d =
            aside * sample.direction.x + above * sample.direction.y + ahead * sample.direction.z;
        // Texels are narrower toward the poles.
        const double texel =
            texel_angle * std::max(0.05, std::sqrt(std::max(0.0, 1.0 - d.y * d.y)));
        const double level = 0.5 * std::log2(sample.solid_angle / texel) + 0.5;
        const auto number = static_cast<size_t>(
            std::clamp(std::lround(level), 0L, static_cast<long>(light.size()) - 1));
        sum += light[number].at(place_of(d)) * sample.weight;
        weights += sample.weight;
      }
      map.texels[static_cast<size_t>(y) * static_cast<size_t>(map.width) + static_cast<size_t>(x)] =
          Vec3f(sum / weights);
    }
  });
  return map;
}

EnvironmentLight::Map EnvironmentLight::cosine_filtered(const Map& light) {
  Map map{.width = kDiffuseWidth, .height = kDiffuseWidth / 2};
  map.texels.resize(static_cast<size_t>(map.width) * static_cast<size_t>(map.height));
  tbb::parallel_for(0, map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      const Vec3 normal = map.direction(x, y);
      Vec3 sum;
      double weights = 0.0;
      for (int j = 0; j < light.height; ++j) {
        const double angle = std::sin((j + 0.5) / light.height * kPi);
        for (int i = 0; i < light.width; ++i) {
          const double weight = angle * std::max(0.0, dot(normal, light.direction(i, j)));
          if (weight <= 0.0) continue;
          sum += Vec3(light.texels[static_cast<size_t>(j * light.width + i)]) * weight;
          weights += weight;
        }
      }
      map.texels[static_cast<size_t>(y) * static_cast<size_t>(map.width) + static_cast<size_t>(x)] =
          Vec3f(sum / weights);
    }
  });
  return map;
}

EnvironmentLight::EnvironmentLight(Vec3 uniform) : uniform_(uniform) {}

EnvironmentLight::EnvironmentLight(Source source) : source_(std::move(source)) {
  std::vector<Map> light(1);
  Map& sharp = light.front();
  sharp.width = kSourceWidth;
  sharp.height = kSourceWidth / 2;
  sharp.texels.resize(static_cast<size_t>(sharp.width) * static_cast<size_t>(sharp.height));
  tbb::parallel_for(0, sharp.height, [&](int y) {
    for (int x = 0; x < sharp.width; ++x) {
      Vec3 sum;
      for (int j = 0; j < kRaysPerSide; ++j)
        for (int i = 0; i < kRaysPerSide; ++i)
          sum += source_(direction_at((x + (i + 0.5) / kRaysPerSide) / sharp.width,
                                      (y + (j + 0.5) / kRaysPerSide) / sharp.height),
                         2.0 * kPi / (kRaysPerSide * kSourceWidth));
      sharp.texels[static_cast<size_t>(y) * static_cast<size_t>(sharp.width) +
                   static_cast<size_t>(x)] = Vec3f(sum / (kRaysPerSide * kRaysPerSide));
    }
  });
  while (light.back().width > 8) light.push_back(light.back().halved());
  const auto coarse =
      std::ranges::find_if(light, [](const Map& m) { return m.width <= kDiffuseWidth; });
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
    return n == 0 ? source_(direction, kSharp) : maps_[static_cast<size_t>(n - 1)].at(at);
  };
  if (part == 0.0) return map(below);
  return map(below) * (1.0 - part) + map(below + 1) * part;
}

Vec3 EnvironmentLight::diffuse(Vec3 normal) const {
  return source_ ? diffuse_.at(place_of(normal)) : uniform_;
}

}  // namespace lenticule::render
