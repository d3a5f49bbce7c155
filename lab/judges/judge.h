// SPDX-License-Identifier: Apache-2.0
// Counterparts of the renderer in `lenticule bench models`: a plain camera, so that pictures can be
// compared with those of another renderer, the studio as a picture, and the judge, a program that
// draws pictures with that renderer. A judge is called with one argument, the file of jobs
// (scripts/three-judge/draw-pictures states the format), and writes for each job either its picture
// or, in PICTURE.txt, the reason why there is none.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "optics/rig.h"
#include "optics/vec.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::lab {

struct JudgeJob {
  std::string model{};
  std::string picture{};  ///< PNG file to write
  int side_px = 0;
  /// If empty, the judge frames its own bounds of the model as framing_camera() does.
  std::optional<render::Camera> camera{};
  std::string environment{};         ///< latitude-longitude picture
  Vec3 environment_ahead{0, 0, -1};  ///< horizontal world direction of that picture's middle
  /// Factor for the intensities of the file's lights, in the units of glTF: a light of intensity 1
  /// gives a white surface the radiance 1 / pi.
  double light_scale = 1.0;
};

/// Removes older pictures of the jobs, writes `jobs_file` and runs the judge. Returns an empty
/// text, or why the judge as a whole failed: its last line of output, or that it exceeded the time.
/// Throws Error(Failed) if it cannot be started or the file cannot be written.
[[nodiscard]] std::string run_judge(const std::string& program,
                                    const std::filesystem::path& jobs_file,
                                    const std::vector<JudgeJob>& jobs, std::chrono::seconds limit);

/// Returns why there is no picture for a job; empty if there is one.
[[nodiscard]] std::string missing_picture(const JudgeJob& job);

// Renders models as a plain camera sees them, so that the picture can be compared with that of
// another renderer: a rig with one lens per pixel, whose lenses all look at the same eye.

/// Vertical field of view of framing_camera().
inline constexpr double kModelFovDegrees = 30.0;

/// Returns a square rig whose subpixels send their rays through one eye. Seen from there each lens
/// shows the centre of its pixel, where all three channels lie, and the panel spans
/// `vertical_fov_degrees`.
[[nodiscard]] optics::Rig plain_camera_rig(int side_px, double vertical_fov_degrees);

/// Returns the direction from a model to framing_camera(): in front, to the right and above, in
/// glTF's axes (y up, +z in front).
[[nodiscard]] Vec3 toward_framing_camera();
/// Returns the horizontal direction from that camera past the model, where the renderer puts the
/// middle of an environment picture.
[[nodiscard]] Vec3 environment_ahead();
/// Returns the camera that looks at the middle of the scene's bounds and sees its meshes as large
/// as possible, with a margin, in a square picture. The scene has no nodes. Throws Error(Input) for
/// a scene without meshes or extent.
[[nodiscard]] render::Camera framing_camera(const render::SceneDescription& scene);

/// Returns the placement that puts the camera at the rig's eye and leaves depth undistorted. The
/// camera must have the field of view of the rig.
[[nodiscard]] render::StageOptions plain_camera_stage(const render::Camera& camera,
                                                      const optics::Rig& rig);

// The renderer's studio as a picture, so that every renderer can be given the same one.

/// Writes render::studio_light() as a latitude-longitude picture (Radiance RGBE), the direction -z
/// in its middle. Throws Error(Failed) if the file cannot be written.
void write_studio(const std::filesystem::path& file, int width, int height);
}  // namespace lenticule::lab
