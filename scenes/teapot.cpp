// SPDX-License-Identifier: Apache-2.0
// Scene: the teapot on its board, with the counts, the viewpoint and the lights of the classic test
// scene.
#include "scenes/scene_functions.h"
#include "scenes/scene_writer.h"
#include "scenes/teapot_mesh.h"

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
  out.light({-3.1, 9.8, 12.1});
  out.light({11.3, 5.1, 8.8});

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

}  // namespace lenticule::scenes
