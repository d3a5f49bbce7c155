// SPDX-License-Identifier: Apache-2.0
// Computes the result of an ideal calibration by tracing rays.
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "calib/simulation/sheet_shape.h"

namespace lenticule::calib {
namespace {

struct Node {
  double place = 0.0;  // fraction of half the aperture
  double weight = 0.0;
};
/// Gauss-Legendre with eight nodes: exact for aberrations up to the 15th order of the height.
constexpr std::array<Node, 4> kHalfNodes{{{0.1834346424956498, 0.3626837833783620},
                                          {0.5255324099163290, 0.3137066458778873},
                                          {0.7966664774136267, 0.2223810344533745},
                                          {0.9602898564975363, 0.1012285362903763}}};

struct Landings {
  std::array<ApertureRay, 2 * kHalfNodes.size()> rays;
  size_t count = 0;
};

/// Returns the landing points of the rays from `eye` (coordinates of the lens), over the whole
/// lens.
Landings land_over_aperture(const LensStack& stack, Vec3 eye) {
  Landings landings;
  for (const Node& node : kHalfNodes) {
    for (const double side : {-1.0, 1.0}) {
      const double height = side * node.place * stack.pitch_mm / 2.0;
      const std::optional<ApertureRay> ray = aperture_ray(stack, height, eye);
      if (ray) landings.rays[landings.count++] = {ray->landing, ray->weight * node.weight};
    }
  }
  return landings;
}

std::optional<Vec2> mean_landing(const Landings& landings) {
  Vec2 sum;
  double weights = 0.0;
  for (size_t i = 0; i < landings.count; ++i) {
    sum = sum + landings.rays[i].landing * landings.rays[i].weight;
    weights += landings.rays[i].weight;
  }
  if (weights == 0.0) return std::nullopt;
  return sum * (1.0 / weights);
}

/// Returns the landing point that the phase of fringes of one lens pitch indicates, near `mean`.
Vec2 fringe_landing(const Landings& landings, Vec2 mean, double pitch_mm) {
  const double wave = 2.0 * std::numbers::pi / pitch_mm;
  std::complex<double> sum;
  for (size_t i = 0; i < landings.count; ++i) {
    const ApertureRay& ray = landings.rays[i];
    sum += std::polar(ray.weight, wave * (ray.landing.x - mean.x));
  }
  return {mean.x + std::arg(sum) / wave, mean.y};
}

/// Returns the landing point, as a point of the panel, of a lens whose apex line passes through
/// `apex`.
std::optional<Vec2> mean_panel_point(const SheetShape& shape, Vec2 apex, int channel, Vec3 eye,
                                     LightMiddle middle) {
  const LocalLenses lenses = shape.lenses_at(apex, channel);
  const Stance stance = shape.stance_at(apex);
  const Vec3 from = stance.local(eye - stance.point);
  const Vec2 u = lenses.across();
  const Vec3 eye_of_lens{u.x * from.x + u.y * from.y, u.x * from.y - u.y * from.x, from.z};
  const Landings landings = land_over_aperture(lenses.stack, eye_of_lens);
  std::optional<Vec2> mean = mean_landing(landings);
  if (!mean) return std::nullopt;
  if (middle == LightMiddle::FringePhase) {
    mean = fringe_landing(landings, *mean, lenses.stack.pitch_mm);
  }
  return Vec2{apex.x + u.x * mean->x - u.y * mean->y, apex.y + u.y * mean->x + u.x * mean->y};
}

}  // namespace

/// Solves for the lens iteratively: a lens that lands beside the point is moved by the miss. Moving
/// a lens moves its landing by nearly the same amount (the difference is gap over distance), so a
/// few steps reach the last digit.
std::optional<TrueView> true_view(const SheetShape& shape, Vec2 panel_point_mm, int channel,
                                  Vec3 eye, LightMiddle middle) {
  Vec2 apex = panel_point_mm;
  for (int step = 0; step < 60; ++step) {
    const std::optional<Vec2> landing = mean_panel_point(shape, apex, channel, eye, middle);
    if (!landing) break;
    const Vec2 miss = panel_point_mm - *landing;
    apex = apex + miss;
    if (std::abs(miss.x) + std::abs(miss.y) < 1e-12) {
      const LocalLenses lenses = shape.lenses_at(apex, channel);
      const Stance stance = shape.stance_at(apex);
      const Vec2 aim = straight_aim(lenses.stack, stance.local(eye - stance.point));
      return TrueView{lenses.coordinate, stance.point + stance.tangent * aim.x + Vec3{0, aim.y, 0}};
    }
  }
  return std::nullopt;
}

}  // namespace lenticule::calib
