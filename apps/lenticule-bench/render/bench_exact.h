// SPDX-License-Identifier: Apache-2.0
// Declares the parts of `lenticule bench exact` that tests and other benchmarks use.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench.h"

namespace lenticule::bench {

struct ExactFlags : RunFlags {
  std::vector<std::string> scenes = {"teapot", "balls", "tree"};
  int depth = 1;
  int lights = 2;
  bool rates = false;
  bool upright = false;
  bool scaling = false;
  bool growth = false;
  bool peers = false;
  double peer_mrays = 0.0;                 ///< 0 = as many as the frame has subpixels
  int peer_limit_s = 900;                  ///< per run of Tachyon
  std::optional<optics::Rig> rig_instead;  ///< loaded from a file
  std::string peer_pictures;
  std::string plots;  ///< folder; empty = none
};

/// Runs Tachyon on the same scene, interleaved with this renderer. Returns {"scene", "width",
/// "height", "threads", "ours_seconds", "ours_mray_s", "rows": [{"name", "runs", "seconds",
/// "mray_s", "ours_over_theirs", "target", "within_target", "failure"}]}; what was not measured is
/// left out.
[[nodiscard]] nlohmann::json measure_peers(const ExactFlags& flags, const std::string& scene);
}  // namespace lenticule::bench
