// SPDX-License-Identifier: Apache-2.0
// Two functions per built-in scene, for the table in scene_list.cpp: one for its camera, one for
// all other content. The caller has validated the options.
#pragma once

#include "scenes/scene_list.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {

[[nodiscard]] View balls_camera(const SceneOptions& options);
void write_balls(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View demo_camera(const SceneOptions& options);
void write_demo(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View gears_camera(const SceneOptions& options);
void write_gears(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View lattice_camera(const SceneOptions& options);
void write_lattice(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View mount_camera(const SceneOptions& options);
void write_mount(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View primitives_camera(const SceneOptions& options);
void write_primitives(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View rings_camera(const SceneOptions& options);
void write_rings(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View room_camera(const SceneOptions& options);
void write_room(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View small_balls_camera(const SceneOptions& options);
void write_small_balls(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View teapot_camera(const SceneOptions& options);
void write_teapot(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View tetra_camera(const SceneOptions& options);
void write_tetra(SceneWriter& out, const SceneOptions& options);
[[nodiscard]] View tree_camera(const SceneOptions& options);
void write_tree(SceneWriter& out, const SceneOptions& options);

inline constexpr int kDemoFrames = 48;
inline constexpr int kTeapotFrames = 612;
inline constexpr int kRoomFrames = 634;
inline constexpr int kSmallBallsFrames = 421;
inline constexpr int kPrimitivesFrames = 512;
inline constexpr int kTreeFrames = 612;
inline constexpr int kGearsFrames = 612;
inline constexpr int kProceduralFrames = 360;  ///< length for scenes that vary only in size

}  // namespace lenticule::scenes
