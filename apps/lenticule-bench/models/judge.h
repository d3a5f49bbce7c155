// SPDX-License-Identifier: Apache-2.0
// A judge is a program that draws pictures of models with another renderer. It is called with one
// argument, the file of jobs (scripts/three-judge/draw-pictures states the format), and writes for
// each job either its picture or, in PICTURE.txt, the reason why there is none.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "optics/vec.h"
#include "render/scene/scene_description.h"

namespace lenticule::bench {

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

/// Returns the file of jobs.
[[nodiscard]] std::string jobs_text(const std::vector<JudgeJob>& jobs);

/// Removes older pictures of the jobs, writes `jobs_file` and runs the judge. Returns an empty
/// text, or why the judge as a whole failed: its last line of output, or that it exceeded the time.
/// Throws Error(Failed) if it cannot be started or the file cannot be written.
[[nodiscard]] std::string run_judge(const std::string& program,
                                    const std::filesystem::path& jobs_file,
                                    const std::vector<JudgeJob>& jobs, std::chrono::seconds limit);

/// Returns why there is no picture for a job; empty if there is one.
[[nodiscard]] std::string missing_picture(const JudgeJob& job);

}  // namespace lenticule::bench
