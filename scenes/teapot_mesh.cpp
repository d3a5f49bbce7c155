// SPDX-License-Identifier: Apache-2.0
// Scene: the teapot on its board, with the counts, the viewpoint and the lights of the classic test
// scene.
#include "scenes/teapot_mesh.h"

#include <array>

#include "scenes/scene_list.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {
namespace {

constexpr Vec3 kFrom{4.86, 7.2, 5.4};
constexpr Vec3 kAt{0, 0, 1.5};
constexpr double kHalfBoard = 5.0;

}  // namespace

View teapot_camera(const SceneOptions& options) {
  return turned_view({.from = kFrom, .at = kAt}, options.frame, kTeapotFrames);
}

void write_teapot(SceneWriter& out, const SceneOptions& options) {
  out.comment("Newell's teapot on a board");
  out.background({0.078, 0.361, 0.753});
  out.lights({{-3.1, 9.8, 12.1}, {11.3, 5.1, 8.8}});
  write_checker_board(out, {.corner = {-kHalfBoard, -kHalfBoard, 0},
                            .along = {2 * kHalfBoard, 0, 0},
                            .across = {0, 2 * kHalfBoard, 0},
                            .columns = options.size,
                            .rows = options.size,
                            .even = {.colour = {0.95, 0.9, 0.8}, .diffuse = 0.8, .specular = 0.2},
                            .odd = {.colour = {0.3, 0.14, 0.1}, .diffuse = 0.8, .specular = 0.2}});

  out.fill({.colour = {1.0, 0.6, 0.2}, .diffuse = 0.75, .specular = 0.35, .shine = 30.0});
  for (const SurfaceTriangle& triangle : teapot_triangles(options.size)) out.patch(triangle);
}

namespace {

/// Control points: rows run along u, columns along v; du x dv points outward.
using Patch = std::array<std::array<Vec3, 4>, 4>;

/// Ring is a control ring of the body. Its quarter arcs are cubics with inner control points at
/// `bulge` radii.
struct Ring {
  double radius;
  double height;
  double bulge = 0.56;
};
using Profile = std::array<Ring, 4>;

// Ordered from top to bottom on the outside, so that du x dv points outward. The knob's widest ring
// is the only one whose quarter arcs bulge slightly more.
constexpr std::array<Profile, 6> kRevolved = {{
    {{{0.0, 3.15}, {0.8, 3.15, 0.5625}, {0.0, 2.85}, {0.2, 2.7}}},     // knob
    {{{0.2, 2.7}, {0.4, 2.55}, {1.3, 2.55}, {1.3, 2.4}}},              // lid
    {{{1.4, 2.4}, {1.3375, 2.53125}, {1.4375, 2.53125}, {1.5, 2.4}}},  // rim
    {{{1.5, 2.4}, {1.75, 1.875}, {2.0, 1.35}, {2.0, 0.9}}},            // upper body
    {{{2.0, 0.9}, {2.0, 0.45}, {1.5, 0.225}, {1.5, 0.15}}},            // lower body
    {{{1.5, 0.15}, {1.5, 0.075}, {1.425, 0.0}, {0.0, 0.0}}},           // bottom
}};

// The halves of handle and spout with y >= 0; the other halves are their mirror images.
constexpr std::array<Patch, 4> kHalves = {{
    {{{{{-1.6, 0, 2.025}, {-1.6, 0.3, 2.025}, {-1.5, 0.3, 2.25}, {-1.5, 0, 2.25}}},
      {{{-2.3, 0, 2.025}, {-2.3, 0.3, 2.025}, {-2.5, 0.3, 2.25}, {-2.5, 0, 2.25}}},
      {{{-2.7, 0, 2.025}, {-2.7, 0.3, 2.025}, {-3, 0.3, 2.25}, {-3, 0, 2.25}}},
      {{{-2.7, 0, 1.8}, {-2.7, 0.3, 1.8}, {-3, 0.3, 1.8}, {-3, 0, 1.8}}}}},
    {{{{{-2.7, 0, 1.8}, {-2.7, 0.3, 1.8}, {-3, 0.3, 1.8}, {-3, 0, 1.8}}},
      {{{-2.7, 0, 1.575}, {-2.7, 0.3, 1.575}, {-3, 0.3, 1.35}, {-3, 0, 1.35}}},
      {{{-2.5, 0, 1.125}, {-2.5, 0.3, 1.125}, {-2.65, 0.3, 0.9375}, {-2.65, 0, 0.9375}}},
      {{{-2, 0, 0.9}, {-2, 0.3, 0.9}, {-1.9, 0.3, 0.6}, {-1.9, 0, 0.6}}}}},
    {{{{{1.7, 0, 1.425}, {1.7, 0.66, 1.425}, {1.7, 0.66, 0.6}, {1.7, 0, 0.6}}},
      {{{2.6, 0, 1.425}, {2.6, 0.66, 1.425}, {3.1, 0.66, 0.825}, {3.1, 0, 0.825}}},
      {{{2.3, 0, 2.1}, {2.3, 0.25, 2.1}, {2.4, 0.25, 2.025}, {2.4, 0, 2.025}}},
      {{{2.7, 0, 2.4}, {2.7, 0.25, 2.4}, {3.3, 0.25, 2.4}, {3.3, 0, 2.4}}}}},
    {{{{{2.7, 0, 2.4}, {2.7, 0.25, 2.4}, {3.3, 0.25, 2.4}, {3.3, 0, 2.4}}},
      {{{2.8, 0, 2.475}, {2.8, 0.25, 2.475}, {3.525, 0.25, 2.49375}, {3.525, 0, 2.49375}}},
      {{{2.9, 0, 2.475}, {2.9, 0.15, 2.475}, {3.45, 0.15, 2.5125}, {3.45, 0, 2.5125}}},
      {{{2.8, 0, 2.4}, {2.8, 0.15, 2.4}, {3.2, 0.15, 2.4}, {3.2, 0, 2.4}}}}},
}};

Vec3 quarter_turn(Vec3 p) { return {-p.y, p.x, p.z}; }

Patch quarter_of(const Profile& profile) {
  Patch patch;
  for (size_t i = 0; i < 4; ++i) {
    const auto [r, z, bulge] = profile[i];
    patch[i] = {Vec3{r, 0, z}, Vec3{r, r * bulge, z}, Vec3{r * bulge, r, z}, Vec3{0, r, z}};
  }
  return patch;
}

Patch mapped(Patch patch, auto map) {
  for (auto& row : patch)
    for (Vec3& p : row) p = map(p);
  return patch;
}

/// Mirrors in y and reverses the columns, so that du x dv still points outward.
Patch mirrored(const Patch& patch) {
  Patch out = mapped(patch, [](Vec3 p) { return Vec3{p.x, -p.y, p.z}; });
  for (auto& row : out) row = {row[3], row[2], row[1], row[0]};
  return out;
}

std::vector<Patch> teapot_patches() {
  std::vector<Patch> patches;
  for (const Profile& profile : kRevolved) {
    Patch quarter = quarter_of(profile);
    for (int k = 0; k < 4; ++k) {
      patches.push_back(quarter);
      quarter = mapped(quarter, quarter_turn);
    }
  }
  for (const Patch& half : kHalves) {
    patches.push_back(half);
    patches.push_back(mirrored(half));
  }
  return patches;
}

struct Bernstein {
  std::array<double, 4> value;
  std::array<double, 4> slope;
};

/// Returns the basis at i / n. Both halves are computed alike, so that a patch traversed backwards
/// gives the same bits.
Bernstein bernstein(int i, int n) {
  const double t = static_cast<double>(i) / n;
  const double s = static_cast<double>(n - i) / n;
  return {{s * s * s, 3 * (t * s) * s, 3 * (t * s) * t, t * t * t},
          {-3 * s * s, 3 * s * (s - 2 * t), 3 * t * (2 * s - t), 3 * t * t}};
}

/// Sums in pairs from the ends inward, so that the reverse order gives the same bits.
Vec3 weighted(const std::array<double, 4>& w, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  return (a * w[0] + d * w[3]) + (b * w[1] + c * w[2]);
}

Vec3 evaluate(const Patch& p, const std::array<double, 4>& u, const std::array<double, 4>& v) {
  const auto row = [&](size_t i) { return weighted(v, p[i][0], p[i][1], p[i][2], p[i][3]); };
  return weighted(u, row(0), row(1), row(2), row(3));
}

/// Returns the normal at the poles, where all columns of a patch meet on the axis and du x dv
/// vanishes. The tangents are horizontal there, so the limit of the normal is the axis.
Vec3 pole_normal(Vec3 position) {
  constexpr double kHalfHeight = 1.5;
  return {0, 0, position.z > kHalfHeight ? 1.0 : -1.0};
}

/// Returns the surface point at (i, j) of n steps in each direction.
SurfacePoint surface_point(const Patch& patch, int i, int j, int n) {
  const Bernstein u = bernstein(i, n);
  const Bernstein v = bernstein(j, n);
  const Vec3 normal = cross(evaluate(patch, u.slope, v.value), evaluate(patch, u.value, v.slope));
  constexpr double kVanishes = 1e-9;
  if (length(normal) < kVanishes) {
    const Vec3 pole = patch[i == 0 ? 0 : 3][0];  // independent of rounding that depends on j
    return {pole, pole_normal(pole)};
  }
  return {evaluate(patch, u.value, v.value), normalized(normal)};
}

bool has_area(const SurfaceTriangle& t) {
  constexpr double kSamePoint = 1e-12;
  return length(t[0].position - t[1].position) > kSamePoint &&
         length(t[1].position - t[2].position) > kSamePoint &&
         length(t[2].position - t[0].position) > kSamePoint;
}

void cut_patch(const Patch& patch, int size, std::vector<SurfaceTriangle>& out) {
  const auto point = [&](int i, int j) { return surface_point(patch, i, j, size); };
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const SurfacePoint a = point(i, j);
      const SurfacePoint b = point(i + 1, j);
      const SurfacePoint c = point(i + 1, j + 1);
      const SurfacePoint d = point(i, j + 1);
      for (const SurfaceTriangle& triangle : {SurfaceTriangle{a, b, c}, SurfaceTriangle{a, c, d}})
        if (has_area(triangle)) out.push_back(triangle);
    }
  }
}

}  // namespace

std::vector<SurfaceTriangle> teapot_triangles(int size) {
  std::vector<SurfaceTriangle> triangles;
  const auto n = static_cast<size_t>(size);
  triangles.reserve(64 * n * n);
  for (const Patch& patch : teapot_patches()) cut_patch(patch, size, triangles);
  return triangles;
}

}  // namespace lenticule::scenes
