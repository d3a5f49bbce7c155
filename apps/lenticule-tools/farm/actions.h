// SPDX-License-Identifier: Apache-2.0
// The actions of `lenticule farm`: plan.cpp has plan and verify, work.cpp render, merge and feed,
// cluster.cpp submit and status.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/film_renderer.h"
#include "base/exit_code.h"
#include "farm/plan.h"
#include "farm/slurm.h"
#include "farm/work_folder.h"

namespace lenticule::tools {

/// FarmFlags are the flags of all actions; each declares and reads its own.
struct FarmFlags {
  ExitCode (*action)(const FarmFlags& flags) = nullptr;  ///< the one that was given
  std::string folder;                                    ///< work folder
  std::string output;   ///< film, or ring; of merge empty: as planned
  std::string program;  ///< lenticule as the nodes call it; empty: this program's path
  int threads = 0;
  bool overwrite = false;
  bool json = false;

  // plan
  RenderFlags render;
  std::vector<std::string> arguments{};  ///< the flags of `render` as they were given
  std::string chunk_frames = "auto";
  int timed_frames = 3;
  // render
  uint64_t chunk = 0;
  // submit
  bool slurm = false;
  bool dry_run = false;
  farm::SlurmOptions options;
  // status
  bool watch = false;
  // merge
  int wait_seconds = 0;
  bool partial = false;
  // verify
  uint64_t sample = 8;
  uint64_t seed = 0;
  // feed
  double ring_timeout = 10.0;
};
[[nodiscard]] ExitCode farm_plan(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_render(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_submit(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_status(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_merge(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_verify(const FarmFlags& flags);
[[nodiscard]] ExitCode farm_feed(const FarmFlags& flags);

/// Returns this program's name for scripts on other machines: `given`, or the path of lenticule.
[[nodiscard]] std::string farm_program(const std::string& given);

[[nodiscard]] inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// PlannedFilm renders frames of a farm's plan as `lenticule render` does with the same flags.

class PlannedFilm {
 public:
  /// Throws Error(Input) if the plan was made by another version, or if an input has changed since.
  PlannedFilm(const farm::Plan& plan, int threads);

  [[nodiscard]] FilmRenderer& renderer() { return *renderer_; }
  [[nodiscard]] int threads() const;
  /// Throws Error(Input) if the numbered scene files of the chunk have changed.
  void require_inputs_of(const farm::Chunk& chunk) const;

 private:
  const farm::Plan& plan_;
  RenderFlags flags_;
  std::unique_ptr<FilmRenderer> renderer_;
};

}  // namespace lenticule::tools
