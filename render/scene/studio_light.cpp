// SPDX-License-Identifier: Apache-2.0
#include "render/scene/studio_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace lenticule::render {
namespace {

/// SoftBox is a rectangle of light on the plane that touches the unit sphere at `towards`. Its
/// edges fade over `edge` on each side.
struct SoftBox {
  Vec3 towards;
  double half_width;
  double half_height;
  double edge;
  double light;
};

constexpr std::array<SoftBox, 5> kBoxes{{
    {{-0.62, 0.45, 0.64}, 0.42, 0.42, 0.12, 5.0},   // key, upper left before the model
    {{0.80, 0.10, 0.60}, 0.22, 0.60, 0.10, 3.5},    // strip, right
    {{0.00, 1.00, 0.00}, 0.80, 0.50, 0.20, 1.6},    // ceiling
    {{0.70, 0.35, -0.62}, 0.30, 0.50, 0.10, 3.0},   // rim, right behind the model
    {{-0.85, 0.10, -0.52}, 0.18, 0.60, 0.10, 3.0},  // rim, left behind the model
}};

constexpr double kFloor = 0.60;
constexpr double kCeiling = 0.85;
/// Sets the light of a white matt surface that faces the viewer to 1.
constexpr double kExposure = 0.6087;

double smooth_step(double low, double high, double v) {
  const double t = std::clamp((v - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// PlacedBox is a SoftBox with the axes of its plane.
struct PlacedBox {
  Vec3 towards, right, up;
  SoftBox box;

  explicit PlacedBox(const SoftBox& of) : towards(normalized(of.towards)), box(of) {
    right = normalized(cross(std::abs(towards.y) > 0.99 ? Vec3{0, 0, -1} : Vec3{0, 1, 0}, towards));
    up = cross(towards, right);
  }

  [[nodiscard]] double light(Vec3 direction) const {
    const double along = dot(direction, towards);
    if (along <= 0.0) return 0.0;
    const double x = std::abs(dot(direction, right)), y = std::abs(dot(direction, up));
    if (x >= (box.half_width + box.edge) * along || y >= (box.half_height + box.edge) * along)
      return 0.0;
    return box.light *
           (1.0 - smooth_step(box.half_width - box.edge, box.half_width + box.edge, x / along)) *
           (1.0 - smooth_step(box.half_height - box.edge, box.half_height + box.edge, y / along));
  }
};

}  // namespace

double studio_light(Vec3 direction) {
  double light = kFloor + (kCeiling - kFloor) * smooth_step(-1.0, 1.0, direction.y);
  static const std::vector<PlacedBox> boxes(kBoxes.begin(), kBoxes.end());
  for (const PlacedBox& box : boxes) light += box.light(direction);
  return light * kExposure;
}

}  // namespace lenticule::render
