// SPDX-License-Identifier: Apache-2.0
#include "render/scene/tone_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lenticule::render {
namespace {

double largest(Vec3 v) {
  return std::max({v.x, v.y, v.z});
}
double smallest(Vec3 v) {
  return std::min({v.x, v.y, v.z});
}
template <class Function>
Vec3 each(Vec3 v, const Function& of) {
  return {of(v.x), of(v.y), of(v.z)};
}

// Khronos PBR Neutral (https://github.com/KhronosGroup/ToneMapping). The darkest channel loses the
// reflection of a dielectric, kFloor; above kStart the brightest channel is compressed.
constexpr double kFloor = 0.04;
constexpr double kStart = 0.8 - kFloor;
constexpr double kDesaturation = 0.15;
constexpr double kRoom = 1.0 - kStart;

Vec3 neutral(Vec3 light) {
  const double low = smallest(light);
  const double floor = low < 2.0 * kFloor ? low - low * low / (4.0 * kFloor) : kFloor;
  const Vec3 lowered = light - Vec3{floor, floor, floor};
  const double peak = largest(lowered);
  if (peak < kStart) return lowered;
  const double shown = 1.0 - kRoom * kRoom / (peak + kRoom - kStart);
  const double kept = 1.0 / (kDesaturation * (peak - shown) + 1.0);
  return lowered * (shown / peak * kept) + Vec3{shown, shown, shown} * (1.0 - kept);
}

// Hill's fit works in its own primaries; the columns of both matrices.
constexpr Affine kAcesIn{
    {0.59719, 0.07600, 0.02840}, {0.35458, 0.90834, 0.13383}, {0.04823, 0.01566, 0.83777}, {}};
constexpr Affine kAcesOut{{1.60475, -0.10208, -0.00327},
                          {-0.53108, 1.10813, -0.07276},
                          {-0.07367, -0.00605, 1.07602},
                          {}};
constexpr double kAcesExposure = 1.0 / 0.6;
// The curve (v^2 + a v - b) / (c v^2 + d v + e).
constexpr double kA = 0.0245786, kB = 0.000090537, kC = 0.983729, kD = 0.4329510, kE = 0.238081;

Vec3 aces(Vec3 light) {
  const Vec3 curved = each(kAcesIn.vector(light * kAcesExposure),
                           [](double v) { return (v * (v + kA) - kB) / (v * (kC * v + kD) + kE); });
  return each(kAcesOut.vector(curved), [](double v) { return std::clamp(v, 0.0, 1.0); });
}

}  // namespace

ToneMap tone_map_named(const std::string& name) {
  if (name == "none") return ToneMap::None;
  if (name == "pbr-neutral") return ToneMap::PbrNeutral;
  if (name == "aces") return ToneMap::Aces;
  throw Error(ErrorKind::Usage, fmt::format("tone map '{}': unknown", name),
              "choose none, pbr-neutral or aces");
}

Vec3 tone_mapped(ToneMap map, Vec3 light) {
  switch (map) {
    case ToneMap::PbrNeutral:
      return neutral(light);
    case ToneMap::Aces:
      return aces(light);
    case ToneMap::None:
      break;
  }
  return light;
}

}  // namespace lenticule::render
