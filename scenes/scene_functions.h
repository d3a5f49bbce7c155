// SPDX-License-Identifier: Apache-2.0
// Two functions per built-in scene, for the table in scene_list.cpp: one for its camera, one for
// all other content. The caller has validated the options.
#pragma once

#include <cmath>
#include <numbers>

#include "scenes/elements.h"
#include "scenes/scene_list.h"
#include "scenes/scene_writer.h"

namespace lenticule::scenes {

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
