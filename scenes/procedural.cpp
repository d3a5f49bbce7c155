// SPDX-License-Identifier: Apache-2.0
// The procedural scenes: each is one shape that is repeated, in an order that its `size` gives.
#include <array>
#include <cmath>
#include <numbers>

#include "scenes/scene_list.h"

namespace lenticule::scenes {

// Scene: a branching tree on a ground that extends to the horizon. Each branch is a tapering cone
// with a sphere at its end, from which two shorter branches grow.

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

Vec3 end_of(const Branch& branch) { return branch.base + branch.along * branch.length; }

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

}  // namespace

View tree_camera(const SceneOptions& options) {
  return turned_view({.from = {4.5, 0.4, 2.0}, .at = {0, 0, 1.5}}, options.frame, kTreeFrames);
}

void write_tree(SceneWriter& out, const SceneOptions& options) {
  out.comment("branching tree");
  out.background({0.078, 0.361, 0.753});
  out.lights({{-5, 5, 50},
              {30, -30, 30},
              {-40, -30, 20},
              {10, 30, 40},
              {-30, 40, 10},
              {50, 25, 20},
              {5, -50, 30}});

  out.fill({.colour = {0.2, 0.7, 0.2}, .diffuse = 0.8});
  out.square(kGround, 0.0);

  out.fill({.colour = {0.65, 0.42, 0.22}, .diffuse = 0.8});
  write_branch(out,
               {.base = {},
                .along = {0, 0, 1},
                .side = {0, 1, 0},
                .length = kTrunkLength,
                .radius = kTrunkRadius},
               options.size);
}

// Scene: layers of meshed gears on a wooden table. All faces are divided into convex
// quadrilaterals, since some readers of NFF do not triangulate concave polygons.

namespace {

/// Number of teeth: a multiple of four, so that a tooth meets a gap toward all four neighbours.
constexpr int kTeeth = 24;
constexpr double kPitchRadius = 0.5;  ///< neighbours' axes are one unit apart
constexpr double kModule = 2.0 * kPitchRadius / kTeeth;
constexpr double kTip = kPitchRadius + 0.8 * kModule;
constexpr double kRoot = kPitchRadius - kModule;
constexpr double kHole = 0.2;
constexpr double kThickness = 0.28;
constexpr double kLayer = 0.5;  ///< distance between layers
constexpr double kPitchAngle = 2.0 * std::numbers::pi / kTeeth;

struct Gear {
  Vec3 centre;  ///< centre of the lower face
  double turn;  ///< angle of a tooth's middle from +x, radians
};

/// One tooth with the gap before it, as angles from the tooth's middle.
struct Tooth {
  double gap;   ///< start of the gap's bottom
  double foot;  ///< end of the gap, start of the tooth
  double tip_begin;
  double tip_end;
  double end;  ///< end of the tooth, start of the next gap
};

Tooth tooth_at(double middle) {
  constexpr double kFoot = 0.31;  // shares of the pitch; half of their sum is below a quarter,
  constexpr double kTop = 0.17;   // so that there is clearance between teeth
  return {middle + (kFoot - 1.0) * kPitchAngle, middle - kFoot * kPitchAngle,
          middle - kTop * kPitchAngle, middle + kTop * kPitchAngle, middle + kFoot * kPitchAngle};
}

class GearShape {
 public:
  GearShape(SceneWriter& out, const Gear& gear) : out_(out), gear_(gear) {}

  void write() {
    for (int k = 0; k < kTeeth; ++k) write_tooth(tooth_at(gear_.turn + kPitchAngle * k));
  }

 private:
  struct Place {
    double radius;
    double angle;
  };

  void write_tooth(const Tooth& t) {
    face({Place{kHole, t.gap}, {kRoot, t.gap}, {kRoot, t.foot}, {kHole, t.foot}});
    face({Place{kHole, t.foot}, {kRoot, t.foot}, {kRoot, t.end}, {kHole, t.end}});
    face({Place{kRoot, t.foot}, {kTip, t.tip_begin}, {kTip, t.tip_end}, {kRoot, t.end}});
    side({kRoot, t.gap}, {kRoot, t.foot});
    side({kRoot, t.foot}, {kTip, t.tip_begin});
    side({kTip, t.tip_begin}, {kTip, t.tip_end});
    side({kTip, t.tip_end}, {kRoot, t.end});
    side({kHole, t.foot}, {kHole, t.gap});
    side({kHole, t.end}, {kHole, t.foot});
  }

  [[nodiscard]] Vec3 at(Place p, double height) const {
    return gear_.centre + Vec3{p.radius * std::cos(p.angle), p.radius * std::sin(p.angle), height};
  }

  /// Writes the top and bottom faces; the corners are counter-clockwise seen from above.
  void face(const std::array<Place, 4>& p) {
    out_.polygon(std::array{at(p[0], kThickness), at(p[1], kThickness), at(p[2], kThickness),
                            at(p[3], kThickness)});
    out_.polygon(std::array{at(p[3], 0), at(p[2], 0), at(p[1], 0), at(p[0], 0)});
  }

  /// Writes an upright face; the gear's inside is on the left when going from a to b.
  void side(Place a, Place b) {
    out_.polygon(std::array{at(a, 0), at(b, 0), at(b, kThickness), at(a, kThickness)});
  }

  SceneWriter& out_;
  Gear gear_;
};

Fill metal(int layer) {
  const std::array<Fill, 4> fills = {{
      {.colour = {0.85, 0.65, 0.30}, .diffuse = 0.65, .specular = 0.3, .shine = 40.0},
      {.colour = {0.62, 0.66, 0.72}, .diffuse = 0.5, .specular = 0.45, .shine = 60.0},
      {.colour = {0.75, 0.22, 0.16}, .diffuse = 0.8, .specular = 0.12, .shine = 25.0},
      // Transparent with little refraction, so that the layers below stay recognizable.
      {.colour = {0.55, 0.80, 0.95},
       .diffuse = 0.35,
       .specular = 0.15,
       .shine = 70.0,
       .transmittance = 0.5,
       .refraction_index = 1.05},
  }};
  return fills[static_cast<size_t>(layer) % fills.size()];
}

void write_gear_layer(SceneWriter& out, int layer, int side) {
  out.fill(metal(layer));
  const double first = -0.5 * (side - 1);
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const bool odd = (row + column) % 2 != 0;
      GearShape(out, {.centre = {first + column, first + row, 0.12 + kLayer * layer},
                      .turn = odd ? kPitchAngle / 2.0 : 0.0})
          .write();
    }
}

}  // namespace

View gears_camera(const SceneOptions& options) {
  const double side = options.size;
  return turned_view({.from = Vec3{1.15, 0.85, 1.25} * side + Vec3{0.6, 0.6, 0.6},
                      .at = {0, 0, 0.55 * kLayer * side},
                      .angle_degrees = 35.0},
                     options.frame, kGearsFrames, 0.3 * side);
}

void write_gears(SceneWriter& out, const SceneOptions& options) {
  const double side = options.size;
  out.comment("layers of meshed gears");
  out.background({0.12, 0.14, 0.18});
  out.lights({Vec3{2, 1, 4} * side, Vec3{-1, 2.5, 3.5} * side, Vec3{-1.5, -1.5, 4} * side,
              Vec3{1.5, -2.5, 3} * side});
  write_floor(out, wood_picture(), {.diffuse = 1.0, .specular = 0.06, .shine = 15.0},
              1.5 * side + 1.0, 0.0, 2);
  for (int layer = 0; layer < options.size; ++layer) write_gear_layer(out, layer, options.size);
}

}  // namespace lenticule::scenes
