// SPDX-License-Identifier: Apache-2.0
// One function per built-in scene, for the table in scene_list.cpp. Options are valid here.
#pragma once

#include <string>

#include "scenes/scene_list.h"

namespace lenticule::scenes {

[[nodiscard]] std::string write_balls(const SceneOptions& options);
[[nodiscard]] std::string write_demo(const SceneOptions& options);
[[nodiscard]] std::string write_teapot(const SceneOptions& options);
[[nodiscard]] std::string write_tree(const SceneOptions& options);

inline constexpr int kDemoFrames = 48;
inline constexpr int kTeapotFrames = 612;

}  // namespace lenticule::scenes
