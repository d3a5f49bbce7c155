// SPDX-License-Identifier: Apache-2.0
// lenticule bench stability tests numerically critical cases against reference implementations
// (oracles) in long double.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <memory>
#include <span>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/print.h"
#include "lab/stability/rows.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

using lab::StabilityCase;

struct StabilityFlags {
  bool quick = false;
  bool full = false;
  std::string row;
  int threads = 0;
  bool json = false;
};

std::span<const StabilityCase> chosen_cases(const std::string& name) {
  const std::vector<StabilityCase>& all = lab::stability_cases();
  if (name.empty()) return all;
  std::string known;
  for (const StabilityCase& one : all) {
    if (name == one.name) return {&one, 1};
    known += (known.empty() ? "" : ", ") + std::string(one.name);
  }
  throw Error(ErrorKind::Usage, fmt::format("--row '{}': unknown", name), "one of " + known);
}

ExitCode run_table(const StabilityFlags& flags) {
  using Clock = std::chrono::steady_clock;
  const std::span<const StabilityCase> cases = chosen_cases(flags.row);
  const lab::StabilitySize size{.full = flags.full, .threads = flags.threads};
  lab::StabilityReport report{.full = flags.full};
  player::Progress progress("stability", "rows", cases.size());
  const Clock::time_point start = Clock::now();
  for (const StabilityCase& one : cases) {
    progress.update(report.rows.size(), one.name);
    report.rows.push_back(one.run(size));
    report.rows.back().of = &one;
    if (player::interrupted()) return player::interrupt_exit_code();
  }
  report.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  progress.update(report.rows.size());
  progress.finish();

  if (flags.json) {
    nlohmann::json result = to_json(report);
    result["machine"] = machine_json();
    print_json(result);
  } else {
    print_out("machine {}, {} size\n{}", machine_text(), flags.full ? "full" : "quick",
              Verbatim{to_text(report)});
  }
  return passes(report) ? kOk : kQuality;
}

}  // namespace

cli::Run declare_bench_stability(CLI::App& app) {
  auto flags = std::make_shared<StabilityFlags>();
  CLI::Option* quick = app.add_flag("--quick", flags->quick, "run for some seconds (default)");
  app.add_flag("--full", flags->full,
               "use hundreds of millions of samples and whole 15360x8640 panels; takes an hour")
      ->excludes(quick);
  app.add_option("--row", flags->row, "run only this row of the table");
  declare_threads(app, flags->threads);
  app.add_flag("--json", flags->json, "print as JSON");
  app.footer(
      "Exit code 0 if every row passes, 5 if one does not.\n"
      "Example:\n  lenticule bench stability --row corners");
  return [flags]() -> ExitCode { return run_table(*flags); };
}

}  // namespace lenticule::bench
