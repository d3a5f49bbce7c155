// SPDX-License-Identifier: Apache-2.0
// The built-in scenes: each is a function that writes NFF text, and beside it what NFF cannot say.
// One file per scene; a new one is a file, a declaration in scene_functions.h and a line in
// scene_list.cpp.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct SceneOptions {
  int size = 1;   ///< how finely or how often; what it counts depends on the scene
  int frame = 0;  ///< any whole number; sequences repeat after BuiltInScene::frames
};

struct BuiltInScene {
  const char* name;
  const char* summary;
  const char* size_meaning;
  int default_size;
  int largest_size;
  int frames;              ///< of the sequence; 1 = still
  bool only_camera_moves;  ///< one NFF text and the camera path say the whole sequence
  View (*camera)(const SceneOptions&);
  void (*write)(SceneWriter&, const SceneOptions&);  ///< everything but the camera
};

[[nodiscard]] const std::vector<BuiltInScene>& scene_list();

/// Throws Error(Usage) that lists the names.
[[nodiscard]] const BuiltInScene& find_scene(std::string_view name);

/// The scene with the pictures that its surfaces wear beside the text, or as one plain NFF text.
/// The same arguments give the same bytes. Without a size: the scene's own. Throws Error(Usage)
/// for a size out of range or a negative frame.
[[nodiscard]] SceneParts build_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                     int frame = 0, Pictures pictures = Pictures::Kept);
[[nodiscard]] std::string write_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                      int frame = 0);
/// The camera of every frame, one a line, as `lenticule render --camera` reads it.
[[nodiscard]] std::string write_camera_path(const BuiltInScene& scene,
                                            std::optional<int> size = {});

}  // namespace lenticule::scenes
