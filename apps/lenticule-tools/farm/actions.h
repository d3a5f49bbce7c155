// SPDX-License-Identifier: Apache-2.0
// The actions of `lenticule farm`, each in a file of its own.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "base/exit_code.h"
#include "farm/slurm.h"

namespace lenticule::tools {

struct FarmPlanFlags {
  RenderFlags render;
  std::string chunk = "auto";
  int timed_frames = 3;
  std::string output;
  std::string work;
  std::string program;  ///< lenticule as the nodes call it; empty: this program's path
  bool overwrite = false;
  bool json = false;
  std::vector<std::string> arguments{};  ///< the flags of `render` as they were given
};
[[nodiscard]] ExitCode farm_plan(const FarmPlanFlags& flags);

struct FarmRenderFlags {
  std::string folder;
  uint64_t chunk = 0;
  int threads = 0;
  bool json = false;
};
[[nodiscard]] ExitCode farm_render(const FarmRenderFlags& flags);

struct FarmSubmitFlags {
  std::string folder;
  bool slurm = false;
  bool dry_run = false;
  bool json = false;
  std::string program;
  farm::SlurmOptions options;
};
[[nodiscard]] ExitCode farm_submit(const FarmSubmitFlags& flags);

struct FarmStatusFlags {
  std::string folder;
  bool watch = false;
  bool json = false;
};
[[nodiscard]] ExitCode farm_status(const FarmStatusFlags& flags);

struct FarmMergeFlags {
  std::string folder;
  std::string output;  ///< empty: as planned
  int wait_seconds = 0;
  bool partial = false;
  bool overwrite = false;
  bool json = false;
};
[[nodiscard]] ExitCode farm_merge(const FarmMergeFlags& flags);

struct FarmVerifyFlags {
  std::string folder;
  uint64_t sample = 8;
  uint64_t seed = 0;
  int threads = 0;
  bool json = false;
};
[[nodiscard]] ExitCode farm_verify(const FarmVerifyFlags& flags);

struct FarmFeedFlags {
  std::string folder;
  std::string output;
  double ring_timeout = 10.0;
  bool json = false;
};
[[nodiscard]] ExitCode farm_feed(const FarmFeedFlags& flags);

/// Returns this program's name for scripts on other machines: `given`, or the path of lenticule.
[[nodiscard]] std::string farm_program(const std::string& given);

}  // namespace lenticule::tools
