// SPDX-License-Identifier: Apache-2.0
// Scene: a cube of pipes, with spheres at the nodes of a grid and cylinders along its edges.
#include <array>

#include "scenes/camera_turn.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {
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

}  // namespace lenticule::scenes
