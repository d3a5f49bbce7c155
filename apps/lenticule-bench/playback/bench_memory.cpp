// SPDX-License-Identifier: Apache-2.0
// lenticule bench memory measures the peak memory of one frame from outside, on a child process.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <thread>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "base/error.h"
#include "base/main_function.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::bench {
namespace {

constexpr std::chrono::milliseconds kPoll{10};

struct MemoryFlags {
  std::string rig;
  std::string scene = "builtin:teapot";
  int threads = 0;
  double limit_mib = 1024.0;
  bool json = false;
};

/// Does everything that `render` does for one frame, except writing it.
void render_one(const MemoryFlags& flags) {
  BenchScene bench({.scene = bench_scene_name(flags.scene),
                    .rig = lab::bench_rig(flags.rig),
                    .threads = flags.threads});
  (void)bench.render(*bench.method(bench.options(render::RenderOptions{}.max_depth)));
}

struct ChildEnd {
  int status = 0;
  double peak_mib = 0.0;
};

/// Waits for the child in slices; a signal to this process ends the child.
ChildEnd wait_for(pid_t child) {
  while (true) {
    ChildEnd end;
    rusage usage{};
    const pid_t ended = wait4(child, &end.status, WNOHANG, &usage);
    if (ended < 0 && errno != EINTR)
      throw Error(ErrorKind::Failed, fmt::format("bench memory: {}", std::strerror(errno)));
    if (ended == child) {
      end.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024.0;
      return end;
    }
    if (player::interrupted()) kill(child, SIGKILL);
    std::this_thread::sleep_for(kPoll);
  }
}

ExitCode measure_memory(const MemoryFlags& flags) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0)
    throw Error(ErrorKind::Failed,
                fmt::format("bench memory: cannot start a process: {}", std::strerror(errno)));
  if (child == 0)
    _exit(run_reporting_errors(
        [&] {
          render_one(flags);
          return kOk;
        },
        {.program = "lenticule"}));
  const ChildEnd end = wait_for(child);
  if (player::interrupted()) return player::interrupt_exit_code();
  if (!WIFEXITED(end.status))
    throw Error(ErrorKind::Failed, fmt::format("bench memory: the renderer was killed by signal {}",
                                               WTERMSIG(end.status)));
  if (WEXITSTATUS(end.status) != 0) return static_cast<ExitCode>(WEXITSTATUS(end.status));

  const bool within = end.peak_mib <= flags.limit_mib;
  if (flags.json)
    print_json({{"benchmark", "memory"},
                {"machine", machine_json()},
                {"scene", flags.scene},
                {"rig", lab::bench_rig(flags.rig).name},
                {"peak_resident_mib", end.peak_mib},
                {"limit_mib", flags.limit_mib},
                {"within_limit", within}});
  else
    print_out("peak resident    {:.1f} MiB (limit {:.0f} MiB)\n", end.peak_mib, flags.limit_mib);
  return within ? kOk : kQuality;
}

}  // namespace

cli::Run declare_bench_memory(CLI::App& app) {
  auto flags = std::make_shared<MemoryFlags>();
  app.add_option("--rig", flags->rig, "rig file (default: the 4K kiosk)");
  app.add_option("--scene", flags->scene, "as for render")->capture_default_str();
  app.add_option("--threads", flags->threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--limit-mib", flags->limit_mib, "limit; a larger peak gives exit code 5")
      ->capture_default_str();
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags]() -> ExitCode { return measure_memory(*flags); };
}

}  // namespace lenticule::bench
