// SPDX-License-Identifier: Apache-2.0
// The procedural scenes: each is one shape that is repeated, in an order that its `size` gives.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "scenes/scene_list.h"

namespace lenticule::scenes {

// Scene: a pyramid of knots. Each knot is six interlocked rings; each ring is a pentagon of
// cylinders with spheres at its corners.

namespace {

/// Returns the six axes through opposite corners of an icosahedron.
std::array<Vec3, 6> ring_axes() {
  const double golden = (1.0 + std::sqrt(5.0)) / 2.0;
  std::array<Vec3, 6> axes = {{{0, 1, golden},
                               {0, -1, golden},
                               {1, golden, 0},
                               {-1, golden, 0},
                               {golden, 0, 1},
                               {-golden, 0, 1}}};
  for (Vec3& axis : axes) axis = normalized(axis);
  return axes;
}

void write_ring(SceneWriter& out, Vec3 centre, Vec3 axis, double radius) {
  constexpr double kTube = 0.09;
  const Vec3 side = normalized(cross(axis, std::abs(axis.z) < 0.5 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
  const Vec3 third = cross(axis, side);
  const auto corner = [&](int k) {
    const double angle = turn_of(k % 5, 5);
    return centre + (side * std::cos(angle) + third * std::sin(angle)) * radius;
  };
  for (int k = 0; k < 5; ++k) {
    out.sphere(corner(k), kTube * radius);
    out.cone(corner(k), kTube * radius, corner(k + 1), kTube * radius);
  }
}

void write_knot(SceneWriter& out, Vec3 centre, double radius) {
  constexpr double kAside = 0.35;  // offset from the centre, so that the rings interlock
  for (const Vec3 axis : ring_axes())
    write_ring(out, centre + axis * (kAside * radius), axis, radius * 0.75);
}

/// Writes a layer; layer 0 is the knot at the top.
void write_layer(SceneWriter& out, int layer, int layers) {
  constexpr std::array<Vec3, 4> kColours = {Vec3{0.90, 0.45, 0.30}, Vec3{0.95, 0.80, 0.40},
                                            Vec3{0.45, 0.70, 0.50}, Vec3{0.40, 0.55, 0.85}};
  out.fill({.colour = kColours[static_cast<size_t>(layer) % kColours.size()],
            .diffuse = 0.6,
            .specular = 0.3,
            .shine = 40.0});
  const double height = 0.75 * (layers - 1 - layer) + 0.55;
  for (int row = 0; row <= layer; ++row)
    for (int column = 0; column <= layer; ++column)
      write_knot(out, {1.05 * (column - 0.5 * layer), 1.05 * (row - 0.5 * layer), height}, 0.5);
}

}  // namespace

View rings_camera(const SceneOptions& options) {
  const double side = options.size;
  return turned_view({.from = Vec3{1.6, 1.1, 0.9} * side + Vec3{0.8, 0.5, 0.8},
                      .at = {0, 0, 0.35 * side},
                      .angle_degrees = 28.0},
                     options.frame, kProceduralFrames);
}

void write_rings(SceneWriter& out, const SceneOptions& options) {
  const double side = options.size;
  out.comment("a pyramid of interlocked rings");
  out.background({0.078, 0.361, 0.753});
  out.light(Vec3{3, 1, 5} * side);
  out.light(Vec3{-1, 3, 5} * side);
  out.light(Vec3{1, -3, 4} * side);
  const double half = 4.0 * side;
  out.fill({.colour = {0.8, 0.78, 0.72}, .diffuse = 0.9, .specular = 0.1, .shine = 20.0});
  out.polygon(std::array{Vec3{half, half, 0}, Vec3{-half, half, 0}, Vec3{-half, -half, 0},
                         Vec3{half, -half, 0}});
  for (int layer = 0; layer < options.size; ++layer) write_layer(out, layer, options.size);
}

// Scene: a cube of pipes, with spheres at the nodes of a grid and cylinders along its edges.

namespace {

struct Grid {
  int cells;
  [[nodiscard]] double step() const { return 2.0 / cells; }
  [[nodiscard]] Vec3 knot(int i, int j, int k) const {
    return Vec3{i * step() - 1.0, j * step() - 1.0, k * step() - 1.0};
  }
};

void write_pipes(SceneWriter& out, const Grid& grid, int i, int j, int k) {
  const double radius = 0.12 * grid.step();
  const Vec3 from = grid.knot(i, j, k);
  if (i < grid.cells) out.cone(from, radius, grid.knot(i + 1, j, k), radius);
  if (j < grid.cells) out.cone(from, radius, grid.knot(i, j + 1, k), radius);
  if (k < grid.cells) out.cone(from, radius, grid.knot(i, j, k + 1), radius);
}

template <class Write>
void for_each_knot(const Grid& grid, Write write) {
  for (int i = 0; i <= grid.cells; ++i)
    for (int j = 0; j <= grid.cells; ++j)
      for (int k = 0; k <= grid.cells; ++k) write(i, j, k);
}

}  // namespace

View lattice_camera(const SceneOptions& options) {
  return turned_view({.from = {3.4, 2.2, 1.6}, .at = {0, 0, 0}, .angle_degrees = 38.0},
                     options.frame, kProceduralFrames);
}

void write_lattice(SceneWriter& out, const SceneOptions& options) {
  const Grid grid{options.size};
  out.comment("a lattice of pipes");
  out.background({0.06, 0.07, 0.10});
  out.light({5, 3, 6});
  out.light({-3, 5, 5});
  out.light({-4, -3, 5});
  out.light({4, -5, 4});
  out.fill({.colour = {0.95, 0.75, 0.30}, .diffuse = 0.75, .specular = 0.3, .shine = 50.0});
  for_each_knot(grid,
                [&](int i, int j, int k) { out.sphere(grid.knot(i, j, k), 0.22 * grid.step()); });
  out.fill({.colour = {0.55, 0.72, 0.98}, .diffuse = 0.95, .specular = 0.15, .shine = 30.0});
  for_each_knot(grid, [&](int i, int j, int k) { write_pipes(out, grid, i, j, k); });
}

// Scene: a tetrahedron of tetrahedra; each consists of four of half its size at its corners.

namespace {

using Corners = std::array<Vec3, 4>;

/// Writes the faces. Corners 0, 1, 2 are counter-clockwise seen from outside; corner 3 is opposite.
void write_faces(SceneWriter& out, const Corners& p) {
  out.polygon(std::array{p[0], p[1], p[2]});
  out.polygon(std::array{p[0], p[3], p[1]});
  out.polygon(std::array{p[1], p[3], p[2]});
  out.polygon(std::array{p[2], p[3], p[0]});
}

void write_pyramid(SceneWriter& out, const Corners& corners, int generations) {
  if (generations == 1) return write_faces(out, corners);
  for (const Vec3 corner : corners) {
    Corners quarter = corners;
    for (Vec3& p : quarter) p = (p + corner) / 2.0;
    write_pyramid(out, quarter, generations - 1);
  }
}

}  // namespace

View tetra_camera(const SceneOptions& options) {
  return turned_view({.from = {1.6, 3.0, 1.9}, .at = {0, 0, 0.55}, .angle_degrees = 32.0},
                     options.frame, kProceduralFrames);
}

void write_tetra(SceneWriter& out, const SceneOptions& options) {
  out.comment("a tetrahedron of tetrahedra");
  out.background({0.078, 0.361, 0.753});
  out.light({2, 5, 4});
  out.light({4, -3, 5});
  out.light({-4, 2, 5});
  out.light({0, 2, 8});
  out.fill({.colour = {1.0, 0.35, 0.16}, .diffuse = 1.0, .specular = 0.15, .shine = 20.0});
  const double edge = std::sqrt(3.0) / 2.0;
  write_pyramid(
      out, {Vec3{-0.5, edge, 0}, Vec3{1, 0, 0}, Vec3{-0.5, -edge, 0}, Vec3{0, 0, std::sqrt(2.0)}},
      options.size);
}

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

void write_table(SceneWriter& out, double half) {
  PicturedMesh table{.fill = {.diffuse = 1.0, .specular = 0.06, .shine = 15.0},
                     .picture = wood_picture()};
  append_board(table, {.corner = {-half, half, 0},
                       .along = {2 * half, 0, 0},
                       .across = {0, -2 * half, 0},
                       .columns = 2,
                       .rows = 2});
  out.pictured(std::move(table));
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
  out.light(Vec3{2, 1, 4} * side);
  out.light(Vec3{-1, 2.5, 3.5} * side);
  out.light(Vec3{-1.5, -1.5, 4} * side);
  out.light(Vec3{1.5, -2.5, 3} * side);
  write_table(out, 1.5 * side + 1.0);
  for (int layer = 0; layer < options.size; ++layer) write_gear_layer(out, layer, options.size);
}

// Scene: a mountain made by midpoint displacement, under four glass balls. A finer mountain keeps
// the corners of a coarser one.

namespace {

/// Returns a pseudo-random value from -1 to 1 for a position in units of 2^-20 of the side; the
/// same on every machine.
double displacement(uint32_t column, uint32_t row) {
  uint32_t h = column * 0x9e3779b1U + row * 0x85ebca77U + 0x51ed27U;
  h = (h ^ (h >> 15)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12)) * 0x297a2d39U;
  return (h ^ (h >> 15)) / 2147483648.0 - 1.0;
}

/// Relief holds heights over a square of 2 x 2 units around the origin.
class Relief {
 public:
  explicit Relief(int halvings) : side_((1 << halvings) + 1), heights_(count()) {
    height(side_ / 2, side_ / 2) = 1.1;  // the summit; corners and other unset points are at 0
    double rough = 0.22;
    for (int step = side_ - 1; step > 1; step /= 2, rough /= 2.0) halve(step, rough);
  }

  [[nodiscard]] int side() const { return side_; }
  [[nodiscard]] Vec3 point(int column, int row) const {
    const auto along = [this](int k) { return 2.0 * k / (side_ - 1) - 1.0; };
    return {along(column), along(row), heights_[index(column, row)]};
  }

 private:
  [[nodiscard]] size_t count() const {
    return static_cast<size_t>(side_) * static_cast<size_t>(side_);
  }
  [[nodiscard]] size_t index(int column, int row) const {
    return static_cast<size_t>(row) * static_cast<size_t>(side_) + static_cast<size_t>(column);
  }
  double& height(int column, int row) { return heights_[index(column, row)]; }

  void halve(int step, double rough) {
    const int half = step / 2;
    for (int row = 0; row < side_; row += half)
      for (int column = 0; column < side_; column += half)
        if (column % step != 0 || row % step != 0) set_middle(column, row, step, rough);
  }

  /// Sets the middle of an edge or of a cell's diagonal, along which the triangles are divided.
  void set_middle(int column, int row, int step, double rough) {
    const int half = step / 2;
    const int dc = column % step == 0 ? 0 : half;
    const int dr = row % step == 0 ? 0 : half;
    if (column == side_ / 2 && row == side_ / 2) return;
    const double mean = (height(column - dc, row - dr) + height(column + dc, row + dr)) / 2.0;
    const auto place = [this](int k) {
      return static_cast<uint32_t>(k) * ((1U << 20) / static_cast<uint32_t>(side_ - 1));
    };
    height(column, row) = std::max(0.0, mean + rough * displacement(place(column), place(row)));
  }

  int side_;
  std::vector<double> heights_;
};

enum class Cover { Grass, Rock, Snow };

Cover cover_of(Vec3 a, Vec3 b, Vec3 c) {
  const double height = (a.z + b.z + c.z) / 3.0;
  if (height > 0.72) return Cover::Snow;
  return height > 0.3 ? Cover::Rock : Cover::Grass;
}

void write_covered(SceneWriter& out, const Relief& relief, Cover cover) {
  const auto triangle = [&](Vec3 a, Vec3 b, Vec3 c) {
    if (cover_of(a, b, c) == cover) out.polygon(std::array{a, b, c});
  };
  for (int row = 0; row + 1 < relief.side(); ++row)
    for (int column = 0; column + 1 < relief.side(); ++column) {
      const Vec3 a = relief.point(column, row);
      const Vec3 c = relief.point(column + 1, row + 1);
      triangle(a, relief.point(column + 1, row), c);
      triangle(a, c, relief.point(column, row + 1));
    }
}

void write_mountain(SceneWriter& out, int size) {
  const Relief relief(size);
  out.fill({.colour = {0.32, 0.50, 0.22}, .diffuse = 0.85});
  write_covered(out, relief, Cover::Grass);
  out.fill({.colour = {0.50, 0.43, 0.37}, .diffuse = 0.85});
  write_covered(out, relief, Cover::Rock);
  out.fill({.colour = {0.95, 0.96, 1.0}, .diffuse = 0.85, .specular = 0.05, .shine = 10.0});
  write_covered(out, relief, Cover::Snow);
}

}  // namespace

View mount_camera(const SceneOptions& options) {
  return turned_view({.from = {-2.6, -1.9, 1.9}, .at = {0, 0, 0.5}, .angle_degrees = 42.0},
                     options.frame, kProceduralFrames);
}

void write_mount(SceneWriter& out, const SceneOptions& options) {
  out.comment("a fractal mountain under four balls");
  out.background({0.45, 0.62, 0.85});
  out.light({-5, -4, 8});
  out.light({3, -5, 6});
  out.light({-4, 4, 6});
  write_mountain(out, options.size);
  out.fill({.colour = {0.9, 0.97, 1.0},
            .diffuse = 0.1,
            .specular = 0.3,
            .shine = 80.0,
            .transmittance = 0.6,
            .refraction_index = 1.5});
  for (const double x : {-0.75, 0.75})
    for (const double y : {-0.75, 0.75}) out.sphere({x, y, 1.0}, 0.22);
}

}  // namespace lenticule::scenes
