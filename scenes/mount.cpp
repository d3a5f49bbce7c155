// SPDX-License-Identifier: Apache-2.0
// Scene: a mountain made by midpoint displacement, under four glass balls. A finer mountain keeps
// the corners of a coarser one.
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
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
