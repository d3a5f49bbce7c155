// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/studio.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "base/file.h"

namespace lenticule::player {
namespace {

/// Lamp is a round lamp whose light fades out at its rim.
struct Lamp {
  Vec3 toward;        ///< direction of its middle
  double cos_bright;  ///< cosine of the angle up to which it has its full light
  double cos_dark;    ///< cosine of the angle where it ends
  Vec3 light;
};

constexpr std::array<Lamp, 3> kLamps{{
    {{-0.6, 0.6, 0.8}, 0.95, 0.88, {4.6, 4.4, 4.1}},
    {{0.9, 0.2, 0.3}, 0.95, 0.90, {1.6, 1.75, 2.0}},
    {{0.0, 1.0, -0.25}, 0.93, 0.80, {2.0, 2.0, 2.0}},
}};
constexpr double kFloor = 0.12;
constexpr double kHorizon = 0.22;
constexpr double kCeiling = 0.45;

double lamp_share(const Lamp& lamp, Vec3 from) {
  const double t = std::clamp(
      (dot(normalized(lamp.toward), from) - lamp.cos_dark) / (lamp.cos_bright - lamp.cos_dark), 0.0,
      1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// Appends a pixel with a shared exponent: value = mantissa / 256 * 2^(exponent - 128).
void append_rgbe(Vec3 light, std::string& bytes) {
  int exponent = 0;
  const double largest = std::max({light.x, light.y, light.z});
  const double scale = std::frexp(largest, &exponent) * 256.0 / largest;
  for (const double part : {light.x, light.y, light.z})
    bytes.push_back(static_cast<char>(static_cast<uint8_t>(part * scale)));
  bytes.push_back(static_cast<char>(static_cast<uint8_t>(exponent + 128)));
}

}  // namespace

Vec3 studio_light(Vec3 from) {
  const double pole = from.y >= 0.0 ? kCeiling : kFloor;
  const double wall = kHorizon + (pole - kHorizon) * std::abs(from.y);
  Vec3 light{wall, wall, wall};
  for (const Lamp& lamp : kLamps) light = light + lamp.light * lamp_share(lamp, from);
  return light;
}

void write_studio(const std::filesystem::path& file, int width, int height) {
  std::string bytes =
      fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", height, width);
  for (int j = 0; j < height; ++j) {
    const double from_up = std::numbers::pi * (j + 0.5) / height;
    for (int i = 0; i < width; ++i) {
      const double azimuth = 2.0 * std::numbers::pi * ((i + 0.5) / width - 0.5);
      append_rgbe(studio_light({std::sin(from_up) * std::sin(azimuth), std::cos(from_up),
                                -std::sin(from_up) * std::cos(azimuth)}),
                  bytes);
    }
  }
  write_text_file(file, bytes);
}

}  // namespace lenticule::player
