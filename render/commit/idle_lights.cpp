// SPDX-License-Identifier: Apache-2.0
#include "render/commit/idle_lights.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "render/culling/primitive_tree.h"

namespace lenticule::render {
namespace {

/// Ball that contains every point where a surface can be lit.
struct Ball {
  Vec3 centre;
  double radius = -1.0;  ///< negative if there is no such point

  [[nodiscard]] bool holds(Vec3 p) const { return length(p - centre) <= radius; }
};

struct Extent {
  Vec3 low{HUGE_VAL, HUGE_VAL, HUGE_VAL};
  Vec3 high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

  void hold(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void hold(const Box& box) {
    hold(box.low);
    hold(box.high);
  }
};

Ball ball_around(const Scene& scene) {
  Extent extent;
  for (const MeshShape& mesh : scene.meshes)
    // The last position is padding, not a vertex.
    for (size_t i = 0; i + 1 < mesh.positions.size(); ++i) extent.hold(Vec3(mesh.positions[i]));
  for (const SphereShape& sphere : scene.spheres) extent.hold(box_of(sphere));
  for (const ConeShape& cone : scene.cones) extent.hold(box_of(cone));
  if (!(extent.low.x <= extent.high.x)) return {};
  Ball ball{(extent.low + extent.high) * 0.5, length(extent.high - extent.low) * 0.5};
  // Margin: secondary rays start off their surfaces, and points are rounded to single precision.
  ball.radius += 16.0 * double{kRoundingMargin} * (length(ball.centre) + ball.radius);
  return ball;
}

/// Returns true if zero times every reflectance of the scene is zero, which requires all of them to
/// be finite.
bool reflects_finitely(const Scene& scene) {
  constexpr double kMost = 1e15;
  const auto moderate = [](double v) { return std::abs(v) < kMost; };
  const auto tame = [&](const Material& m) {
    return m.shine >= 0.0 && moderate(m.shine) && moderate(m.diffuse) && moderate(m.specular) &&
           moderate(m.colour.x) && moderate(m.colour.y) && moderate(m.colour.z);
  };
  const auto plain = [&](const std::shared_ptr<const Texture>& texture) {
    return !texture || std::ranges::all_of(texture->rgba, [&](float v) { return moderate(v); });
  };
  return std::ranges::all_of(scene.materials, tame) && std::ranges::all_of(scene.textures, plain);
}

bool is_black(const SceneLight& light) {
  const auto none = [](double v) { return static_cast<float>(v) == 0.0F; };
  return none(light.colour.x) && none(light.colour.y) && none(light.colour.z);
}

/// Returns true if a spot's cone does not touch the cone around the ball as seen from the light.
bool shines_past(const SceneLight& light, const Ball& ball) {
  if (light.kind != Light::Kind::Spot) return false;
  constexpr double kRounding = 1e-4;  // covers cosines in single precision, with a margin
  const Vec3 way = ball.centre - light.position;
  const double distance = length(way);
  const double aside = std::acos(std::clamp(dot(way, light.direction) / distance, -1.0, 1.0));
  const double nearest = std::max(0.0, aside - std::asin(std::min(1.0, ball.radius / distance)));
  return std::cos(nearest) < light.cos_outer - kRounding;
}

bool is_idle(const SceneLight& light, const Ball& ball) {
  // Close to a light that falls off, intensities are unbounded.
  const bool apart = ball.radius >= 0.0 && !ball.holds(light.position);
  return (is_black(light) && (apart || !light.falls_off)) || (apart && shines_past(light, ball));
}

}  // namespace

size_t remove_idle_lights(Scene& scene) {
  const Ball ball = ball_around(scene);
  const auto idle = [&](const SceneLight& light) { return is_idle(light, ball); };
  // The textures are examined only if a light could be removed.
  if (std::ranges::none_of(scene.lights, idle) || !reflects_finitely(scene)) return 0;
  return std::erase_if(scene.lights, idle);
}

}  // namespace lenticule::render
