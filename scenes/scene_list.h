// SPDX-License-Identifier: Apache-2.0
// List of the built-in scenes. Each scene is a function that writes the elements of NFF, plus
// content that NFF cannot express. A new scene needs a file, a declaration and an entry
// in this file.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "scenes/elements.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct SceneOptions {
  int size = 1;   ///< level of detail or number of repetitions; the meaning depends on the scene
  int frame = 0;  ///< any integer; sequences repeat after BuiltInScene::frames
};

struct BuiltInScene {
  const char* name;
  const char* summary;
  const char* size_meaning;
  int default_size;
  int largest_size;
  int frames;              ///< length of the sequence; 1 = still
  bool only_camera_moves;  ///< one NFF file and the camera path describe the whole sequence
  View (*camera)(const SceneOptions&);
  void (*write)(SceneWriter&, const SceneOptions&);  ///< writes everything except the camera
};

[[nodiscard]] inline Vec3 turned_about_z(Vec3 p, double radians) {
  const double c = std::cos(radians);
  const double s = std::sin(radians);
  return {c * p.x - s * p.y, s * p.x + c * p.y, p.z};
}

/// Returns the angle of a frame within a full turn, in radians. The turn is closed: the frame after
/// the last equals the first.
[[nodiscard]] inline double turn_of(int frame, int frames) {
  return 2.0 * std::numbers::pi * frame / frames;
}

/// Rotates the camera of frame 0 once around the vertical axis (z) through the origin; meanwhile it
/// rises and sinks `waves` times by `rise`.
[[nodiscard]] inline View turned_view(View view, int frame, int frames, double rise = 0.0,
                                      int waves = 1) {
  const double angle = turn_of(frame, frames);
  view.from = turned_about_z(view.from, angle);
  view.from.z += rise * std::sin(waves * angle);
  view.at = turned_about_z(view.at, angle);
  return view;
}

[[nodiscard]] View balls_camera(const SceneOptions& options);
void write_balls(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View demo_camera(const SceneOptions& options);
void write_demo(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View gears_camera(const SceneOptions& options);
void write_gears(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View primitives_camera(const SceneOptions& options);
void write_primitives(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View room_camera(const SceneOptions& options);
void write_room(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View small_balls_camera(const SceneOptions& options);
void write_small_balls(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View teapot_camera(const SceneOptions& options);
void write_teapot(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View tree_camera(const SceneOptions& options);
void write_tree(SceneWriter& out, const SceneOptions& options);

inline constexpr int kDemoFrames = 48;
inline constexpr int kTeapotFrames = 612;
inline constexpr int kRoomFrames = 634;
inline constexpr int kSmallBallsFrames = 421;
inline constexpr int kPrimitivesFrames = 512;
inline constexpr int kTreeFrames = 612;
inline constexpr int kGearsFrames = 612;

[[nodiscard]] inline const std::vector<BuiltInScene>& scene_list() {
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
  };
  return table;
}

/// Returns the scene called `name`; throws Error(Usage) with the list of names if there is none.
[[nodiscard]] inline const BuiltInScene& find_scene(std::string_view name) {
  std::string names;
  for (const BuiltInScene& scene : scene_list()) {
    if (scene.name == name) return scene;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", scene.name);
  }
  throw Error(ErrorKind::Usage, fmt::format("no built-in scene is called '{}'", name),
              "use one of: " + names);
}

/// Validates the options and maps the frame into the sequence.
inline SceneOptions options_of(const BuiltInScene& scene, std::optional<int> size, int frame) {
  const int chosen = size.value_or(scene.default_size);
  if (chosen < 1 || chosen > scene.largest_size)
    throw Error(ErrorKind::Usage,
                fmt::format("{}: size {} is not in 1..{}", scene.name, chosen, scene.largest_size),
                fmt::format("the size of this scene means: {}", scene.size_meaning));
  if (frame < 0)
    throw Error(ErrorKind::Usage, fmt::format("{}: frame {} is negative", scene.name, frame));
  return {.size = chosen, .frame = frame % scene.frames};
}

/// Return the scene: build_scene as data with the pictures of its surfaces, write_scene as one
/// plain NFF text. Equal arguments give equal bytes. Without `size`, the scene's default is used.
/// Throw Error(Usage) for a size out of range or a negative frame.
[[nodiscard]] inline SceneParts build_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                            int frame = 0, Pictures pictures = Pictures::Kept) {
  const SceneOptions options = options_of(scene, size, frame);
  SceneWriter out(pictures);
  out.view(scene.camera(options));
  scene.write(out, options);
  return out.take();
}

[[nodiscard]] inline std::string write_scene(const BuiltInScene& scene,
                                             std::optional<int> size = {}, int frame = 0) {
  return nff_text(build_scene(scene, size, frame, Pictures::Plain));
}

/// Returns the camera of every frame, one per line, in the format that `lenticule render --camera`
/// reads.
[[nodiscard]] inline std::string write_camera_path(const BuiltInScene& scene,
                                                   std::optional<int> size = {}) {
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
