// SPDX-License-Identifier: Apache-2.0
#include "scenes/scene_list.h"

#include <fmt/format.h>

#include "base/error.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {

const std::vector<BuiltInScene>& scene_list() {
  static const std::vector<BuiltInScene> table = {
      {"demo", "a turning teapot between a ball in front of the panel and a column behind it",
       "cuts per teapot patch", 16, 100, kDemoFrames, false, demo_camera, write_demo},
      {"teapot", "the Newell teapot on a chequered board, the camera going round it",
       "cuts per teapot patch, squares along the board", 6, 100, kTeapotFrames, true, teapot_camera,
       write_teapot},
      {"room", "a furnished room with a mirror, a painting and a table, seen from inside",
       "cuts per teapot patch, a quarter of those of the marble ball", 6, 50, kRoomFrames, true,
       room_camera, write_room},
      {"small-balls", "a small sphereflake of mirrors with a glass and a marble ball",
       "generations of spheres", 2, 5, kSmallBallsFrames, true, small_balls_camera,
       write_small_balls},
      {"primitives", "one of everything: balls, cones, boxes, a ring; mirror, glass, pictures",
       "cuts of the ring and of the marble ball", 8, 50, kPrimitivesFrames, true, primitives_camera,
       write_primitives},
      {"tree", "cones that fork with a sphere at every joint, under seven lights",
       "generations of branches above the trunk", 11, 15, kTreeFrames, true, tree_camera,
       write_tree},
      {"gears", "layers of meshed gears on a table, one layer transparent",
       "gears along an edge of the cube", 4, 12, kGearsFrames, true, gears_camera, write_gears},
      {"balls", "a sphereflake: every sphere carries nine of a third of its size",
       "generations of spheres", 4, 6, 1, true, balls_camera, write_balls},
      {"rings", "a pyramid of knots of six interlocked rings each", "layers of the pyramid", 7, 20,
       kProceduralFrames, true, rings_camera, write_rings},
      {"mount", "a fractal mountain under four glass balls", "halvings of its side", 6, 9,
       kProceduralFrames, true, mount_camera, write_mount},
      {"tetra", "a tetrahedron of tetrahedra", "generations", 6, 9, kProceduralFrames, true,
       tetra_camera, write_tetra},
      {"lattice", "a cube of pipes with spheres at its knots", "cells along an edge", 8, 30,
       kProceduralFrames, true, lattice_camera, write_lattice},
  };
  return table;
}

const BuiltInScene& find_scene(std::string_view name) {
  std::string names;
  for (const BuiltInScene& scene : scene_list()) {
    if (scene.name == name) return scene;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", scene.name);
  }
  throw Error(ErrorKind::Usage, fmt::format("no built-in scene is called '{}'", name),
              "use one of: " + names);
}

namespace {

/// Validates the options and maps the frame into the sequence.
SceneOptions options_of(const BuiltInScene& scene, std::optional<int> size, int frame) {
  const int chosen = size.value_or(scene.default_size);
  if (chosen < 1 || chosen > scene.largest_size)
    throw Error(ErrorKind::Usage,
                fmt::format("{}: size {} is not in 1..{}", scene.name, chosen, scene.largest_size),
                fmt::format("the size of this scene means: {}", scene.size_meaning));
  if (frame < 0)
    throw Error(ErrorKind::Usage, fmt::format("{}: frame {} is negative", scene.name, frame));
  return {.size = chosen, .frame = frame % scene.frames};
}

}  // namespace

SceneParts build_scene(const BuiltInScene& scene, std::optional<int> size, int frame,
                       Pictures pictures) {
  const SceneOptions options = options_of(scene, size, frame);
  SceneWriter out(pictures);
  out.view(scene.camera(options));
  scene.write(out, options);
  return out.take();
}

std::string write_scene(const BuiltInScene& scene, std::optional<int> size, int frame) {
  return nff_text(build_scene(scene, size, frame, Pictures::Plain));
}

std::string write_camera_path(const BuiltInScene& scene, std::optional<int> size) {
  std::string text = fmt::format("# {}: from, at, up, vertical field of view\n", scene.name);
  for (int frame = 0; frame < scene.frames; ++frame) {
    const View view = scene.camera(options_of(scene, size, frame));
    text += fmt::format("{:.9g}", view.from.x + 0.0);
    for (const double number : {view.from.y, view.from.z, view.at.x, view.at.y, view.at.z,
                                view.up.x, view.up.y, view.up.z, view.angle_degrees})
      text += fmt::format(" {:.9g}", number + 0.0);
    text += '\n';
  }
  return text;
}

}  // namespace lenticule::scenes
