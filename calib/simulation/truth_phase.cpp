// SPDX-License-Identifier: Apache-2.0
// What an ideal calibration would find: traced, not derived.
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/simulation/sheet_shape.h"

namespace lenticule::calib {
namespace {

struct Node {
  double place = 0.0;  // of half the aperture
  double weight = 0.0;
};
/// Gauss-Legendre with eight nodes: exact for aberrations up to the 15th order of the height.
constexpr std::array<Node, 4> kHalfNodes{{{0.1834346424956498, 0.3626837833783620},
                                          {0.5255324099163290, 0.3137066458778873},
                                          {0.7966664774136267, 0.2223810344533745},
                                          {0.9602898564975363, 0.1012285362903763}}};

/// Mean of where the rays from `eye` (coordinates of the lens) land, over the whole lens.
std::optional<Vec2> mean_landing(const LensStack& stack, Vec3 eye) {
  Vec2 sum;
  double weights = 0.0;
  for (const Node& node : kHalfNodes) {
    for (const double side : {-1.0, 1.0}) {
      const double height = side * node.place * stack.pitch_mm / 2.0;
      const std::optional<ApertureRay> ray = aperture_ray(stack, height, eye);
      if (!ray) continue;
      sum = sum + ray->landing * (ray->weight * node.weight);
      weights += ray->weight * node.weight;
    }
  }
  if (weights == 0.0) return std::nullopt;
  return sum * (1.0 / weights);
}

/// The same for a lens whose apex line passes through `apex`, as a point of the panel.
std::optional<Vec2> mean_panel_point(const SheetShape& shape, Vec2 apex, int channel, Vec3 eye) {
  const LocalLenses lenses = shape.lenses_at(apex, channel);
  const Stance stance = shape.stance_at(apex);
  const Vec3 from = stance.local(eye - stance.point);
  const Vec2 u = lenses.across();
  const Vec3 eye_of_lens{u.x * from.x + u.y * from.y, u.x * from.y - u.y * from.x, from.z};
  const std::optional<Vec2> mean = mean_landing(lenses.stack, eye_of_lens);
  if (!mean) return std::nullopt;
  return Vec2{apex.x + u.x * mean->x - u.y * mean->y, apex.y + u.y * mean->x + u.x * mean->y};
}

}  // namespace

/// A lens that lands beside the point is moved by the miss. Moving a lens moves its landing by
/// nearly as much (the rest is gap over distance), so a few steps reach the last digit.
double truth_phase(const SheetShape& shape, Vec2 panel_point_mm, int channel, Vec3 eye) {
  Vec2 apex = panel_point_mm;
  for (int step = 0; step < 60; ++step) {
    const std::optional<Vec2> landing = mean_panel_point(shape, apex, channel, eye);
    if (!landing) break;
    const Vec2 miss = panel_point_mm - *landing;
    apex = apex + miss;
    if (std::abs(miss.x) + std::abs(miss.y) < 1e-12) {
      return shape.lenses_at(apex, channel).coordinate;
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace lenticule::calib
