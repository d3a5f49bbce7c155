// SPDX-License-Identifier: Apache-2.0
#include "scenes/scene_list.h"

#include <fmt/format.h>

#include "optics/error.h"
#include "scenes/scene_functions.h"

namespace lenticule::scenes {

const std::vector<BuiltInScene>& scene_list() {
  static const std::vector<BuiltInScene> table = {
      {"demo", "a turning teapot between a ball before the glass and a column behind it",
       "cuts per teapot patch", 16, 100, kDemoFrames, write_demo},
      {"teapot", "the Newell teapot on a chequered board, the camera going round it",
       "cuts per teapot patch, squares along the board", 6, 100, kTeapotFrames, write_teapot},
      {"balls", "a sphereflake: every sphere carries nine of a third of its size",
       "generations of spheres", 4, 6, 1, write_balls},
      {"tree", "cones that fork with a sphere at every joint, under seven lights",
       "generations of branches above the trunk", 11, 15, 1, write_tree},
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
              "there are: " + names);
}

std::string write_scene(const BuiltInScene& scene, std::optional<int> size, int frame) {
  const int chosen = size.value_or(scene.default_size);
  if (chosen < 1 || chosen > scene.largest_size)
    throw Error(ErrorKind::Usage,
                fmt::format("{}: size {} is not in 1..{}", scene.name, chosen, scene.largest_size),
                fmt::format("the size of this scene: {}", scene.size_meaning));
  if (frame < 0)
    throw Error(ErrorKind::Usage, fmt::format("{}: frame {} is negative", scene.name, frame));
  return scene.write({.size = chosen, .frame = frame % scene.frames});
}

}  // namespace lenticule::scenes
