// SPDX-License-Identifier: Apache-2.0
// List of the built-in scenes. Each scene is a function that writes the elements of NFF, plus
// content that NFF cannot express. A new scene needs a file, a declaration in scene_functions.h and
// an entry in scene_list.cpp.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

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

[[nodiscard]] const std::vector<BuiltInScene>& scene_list();

/// Returns the scene called `name`; throws Error(Usage) with the list of names if there is none.
[[nodiscard]] const BuiltInScene& find_scene(std::string_view name);

/// Return the scene: build_scene as data with the pictures of its surfaces, write_scene as one
/// plain NFF text. Equal arguments give equal bytes. Without `size`, the scene's default is used.
/// Throw Error(Usage) for a size out of range or a negative frame.
[[nodiscard]] SceneParts build_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                     int frame = 0, Pictures pictures = Pictures::Kept);
[[nodiscard]] std::string write_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                      int frame = 0);
/// Returns the camera of every frame, one per line, in the format that `lenticule render --camera`
/// reads.
[[nodiscard]] std::string write_camera_path(const BuiltInScene& scene,
                                            std::optional<int> size = {});

}  // namespace lenticule::scenes
