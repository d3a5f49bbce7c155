// SPDX-License-Identifier: Apache-2.0
// Scene: a branching tree on a ground that extends to the horizon. Each branch is a tapering cone
// with a sphere at its end, from which two shorter branches grow.
#include <array>
#include <cmath>
#include <numbers>

#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
namespace {

constexpr double kTrunkLength = 0.9;
constexpr double kTrunkRadius = 0.1;
constexpr double kTaper = 0.68;   ///< ratio of the radii at the ends of a branch
constexpr double kShrink = 0.74;  ///< ratio of the lengths of a child and its parent
constexpr double kGround = 50.0;  ///< half the side of the ground

struct Branch {
  Vec3 base;
  Vec3 along;  ///< unit
  Vec3 side;   ///< unit, perpendicular to `along`: the children fork in the plane of the two
  double length;
  double radius;
};

Vec3 end_of(const Branch& branch) {
  return branch.base + branch.along * branch.length;
}

/// Returns the child that leans to the branch's side by `lean` radians. It forks in a plane rotated
/// by slightly more than a quarter turn, so that successive levels do not shadow each other.
Branch child_of(const Branch& branch, double lean) {
  constexpr double kTurn = 100.0 * std::numbers::pi / 180.0;
  const Vec3 along = branch.along * std::cos(lean) + branch.side * std::sin(lean);
  const Vec3 across = branch.side * std::cos(lean) - branch.along * std::sin(lean);
  return {.base = end_of(branch),
          .along = along,
          .side = across * std::cos(kTurn) + cross(along, across) * std::sin(kTurn),
          .length = branch.length * kShrink,
          .radius = branch.radius * kTaper};
}

void write_branch(SceneWriter& out, const Branch& branch, int generations) {
  const Vec3 end = end_of(branch);
  const double end_radius = branch.radius * kTaper;
  out.cone(branch.base, branch.radius, end, end_radius);
  out.sphere(end, end_radius);
  if (generations == 0) return;
  constexpr double kDegree = std::numbers::pi / 180.0;
  write_branch(out, child_of(branch, 33.0 * kDegree), generations - 1);
  write_branch(out, child_of(branch, -42.0 * kDegree), generations - 1);
}

void write_lights(SceneWriter& out) {
  constexpr std::array kLights = {Vec3{-5, 5, 50},  Vec3{30, -30, 30}, Vec3{-40, -30, 20},
                                  Vec3{10, 30, 40}, Vec3{-30, 40, 10}, Vec3{50, 25, 20},
                                  Vec3{5, -50, 30}};
  for (const Vec3 light : kLights) out.light(light);
}

}  // namespace

View tree_camera(const SceneOptions& options) {
  return turned_view({.from = {4.5, 0.4, 2.0}, .at = {0, 0, 1.5}}, options.frame, kTreeFrames);
}

void write_tree(SceneWriter& out, const SceneOptions& options) {
  out.comment("branching tree");
  out.background({0.078, 0.361, 0.753});
  write_lights(out);

  out.fill({.colour = {0.2, 0.7, 0.2}, .diffuse = 0.8});
  out.polygon(std::array{Vec3{kGround, kGround, 0}, Vec3{-kGround, kGround, 0},
                         Vec3{-kGround, -kGround, 0}, Vec3{kGround, -kGround, 0}});

  out.fill({.colour = {0.65, 0.42, 0.22}, .diffuse = 0.8});
  write_branch(out,
               {.base = {},
                .along = {0, 0, 1},
                .side = {0, 1, 0},
                .length = kTrunkLength,
                .radius = kTrunkRadius},
               options.size);
}

}  // namespace lenticule::scenes
