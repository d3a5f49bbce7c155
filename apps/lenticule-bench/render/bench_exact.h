// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench exact`. Each measures into JSON and prints its text from that.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule/cli/command.h"

namespace lenticule::bench {

struct ExactFlags {
  std::vector<std::string> scenes = {"teapot", "balls", "tree"};
  std::string rig;
  int depth = 1;
  int lights = 2;
  int runs = 5;
  int threads = 0;
  bool rates = false;
  bool upright = false;
  bool scaling = false;
  bool growth = false;
  bool peers = false;
  double peer_mrays = 0.0;                 ///< 0 = as many as the frame has subpixels
  int peer_limit_s = 900;                  ///< per run of a peer
  std::optional<optics::Rig> rig_instead;  ///< loaded from a file
  std::string peer_pictures;
  std::string plots;  ///< folder; empty = none
  bool json = false;
};

/// A variant of the whole frame: one step turned off or done differently.
struct ExactVariant {
  const char* name;
  void (*change)(render::RenderOptions& options);
};

/// Returns the variants; the first is the whole frame as `render` makes it.
[[nodiscard]] const std::vector<ExactVariant>& exact_variants();

[[nodiscard]] BenchSetup exact_setup(const ExactFlags& flags, const std::string& scene);

/// Measures bare Embree, visibility, the whole frame and its variants for one scene.
[[nodiscard]] nlohmann::json measure_rates(const ExactFlags& flags, const std::string& scene);
void print_rates(const nlohmann::json& rates);

/// Returns the rig with upright lenses of a whole number of subpixels (8 for the kiosk), with the
/// same panel and cone of views.
[[nodiscard]] optics::Rig upright_rig(const optics::Rig& slanted);
/// Compares whole frames of the flags' rig with those of its upright_rig().
[[nodiscard]] nlohmann::json measure_upright(const ExactFlags& flags, const std::string& scene);
void print_upright(const nlohmann::json& upright);

/// Measures how the cost grows with threads (one JSON for all scenes), and with subpixels,
/// triangles, lights and lenses. Each result has the form {"name", "x_label", "rows"}; plots go to
/// flags.plots.
[[nodiscard]] nlohmann::json measure_scaling(const ExactFlags& flags);
[[nodiscard]] nlohmann::json measure_growth(const ExactFlags& flags);
void print_growth(const nlohmann::json& growth);

/// Runs other ray tracers on the same scene, interleaved with this renderer.
[[nodiscard]] nlohmann::json measure_peers(const ExactFlags& flags, const std::string& scene);
void print_peers(const nlohmann::json& peers);
}  // namespace lenticule::bench
