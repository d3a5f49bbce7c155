// SPDX-License-Identifier: Apache-2.0
// The built-in scenes: each is a function that writes NFF text. One file per scene; a new one is a
// file, a declaration in scene_functions.h and a line in scene_list.cpp.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

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
  int frames;  ///< of the sequence; 1 = still
  std::string (*write)(const SceneOptions&);
};

[[nodiscard]] const std::vector<BuiltInScene>& scene_list();

/// Throws Error(Usage) that lists the names.
[[nodiscard]] const BuiltInScene& find_scene(std::string_view name);

/// The scene's NFF text; the same arguments give the same bytes. Without a size: the scene's own.
/// Throws Error(Usage) for a size out of range or a negative frame.
[[nodiscard]] std::string write_scene(const BuiltInScene& scene, std::optional<int> size = {},
                                      int frame = 0);

}  // namespace lenticule::scenes
