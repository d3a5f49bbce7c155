// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/calibrate/bench_calibrate_stress.h"

#include <fmt/format.h>

#include <chrono>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/simulation/stress_cases.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

using calib::StressCase;
using calib::StressDemand;
using calib::StressLimits;
using calib::StressOutcome;
using calib::StressSize;
using nlohmann::json;

std::vector<StressCase> chosen_cases(const std::string& name) {
  if (name.empty()) return calib::stress_cases();
  std::string known;
  for (const StressCase& one : calib::stress_cases()) {
    if (name == one.name) return {one};
    known += (known.empty() ? "" : ", ") + one.name;
  }
  throw Error(ErrorKind::Usage, fmt::format("--only '{}': unknown", name), "one of " + known);
}

const char* name_of(StressDemand demand) {
  switch (demand) {
    case StressDemand::Good:
      return "good";
    case StressDemand::Detected:
      return "detected";
    case StressDemand::GoodOrDetected:
      return "good or detected";
  }
  return "";
}

json json_of(const StressCase& one, const StressLimits& limits, const StressOutcome& outcome) {
  json out = {{"case", one.name},           {"row", one.row},
              {"what", one.what},           {"demand", name_of(one.demand)},
              {"verdict", outcome.verdict}, {"said", outcome.said},
              {"held", outcome.held},       {"wrong", outcome.wrong},
              {"seconds", outcome.seconds}};
  out["limits"] = {{"flat_lenses", limits.flat_lenses},
                   {"worst_lenses", limits.worst_lenses},
                   {"effective_pitch_error", limits.pitch},
                   {"map_rms_lenses", limits.map_rms_lenses}};
  if (outcome.measured)
    out["figures"] = {
        {"flat_lenses", outcome.flat_lenses},     {"worst_lenses", outcome.errors.worst_lenses},
        {"effective_pitch_error", outcome.pitch}, {"map_rms_lenses", outcome.errors.map_rms_lenses},
        {"pitch_error", outcome.errors.pitch},    {"gap_error", outcome.errors.gap}};
  return out;
}

void print_head(bool full) {
  print_out("machine {}, {} size\n", machine_text(), full ? "full" : "small");
  print_out("{:<15} {:<38} {:<9} {:>7} {:>7} {:>7} {:>8} {:<16} {:>7} {:>7} {:>8} {:<6}\n", "case",
            "what", "outcome", "flat", "worst", "map", "pitch", "demand", "flat", "worst", "pitch",
            "held");
}

void print_case(const StressCase& one, const StressLimits& limits, const StressOutcome& outcome) {
  print_out("{:<15} {:<38} {:<9} ", one.name, one.what, outcome.verdict);
  if (outcome.measured)
    print_out("{:>7.4f} {:>7.4f} {:>7.4f} {:>8.1e} ", outcome.flat_lenses,
              outcome.errors.worst_lenses, outcome.errors.map_rms_lenses, outcome.pitch);
  else
    print_out("{:>7} {:>7} {:>7} {:>8} ", "-", "-", "-", "-");
  if (one.demand == StressDemand::Detected)
    print_out("{:<16} {:>7} {:>7} {:>8} ", name_of(one.demand), "-", "-", "-");
  else
    print_out("{:<16} {:>7.4f} {:>7.4f} {:>8.1e} ", name_of(one.demand), limits.flat_lenses,
              limits.worst_lenses, limits.pitch);
  print_out("{}\n", outcome.held ? "yes" : "MISSED");
  if (!outcome.held || one.demand != StressDemand::Good)
    print_out("    {}\n", outcome.said.empty() ? "no reason is given" : outcome.said);
  if (!outcome.held && !one.shortfall.empty()) print_out("    known: {}\n", one.shortfall);
}

}  // namespace

ExitCode run_calibrate_stress(const CalibrateStressFlags& flags) {
  const std::vector<StressCase> cases = chosen_cases(flags.only);
  const StressSize size = flags.full ? StressSize::Full : StressSize::Small;
  json rows = json::array();
  int missed = 0;
  if (!flags.json) print_head(flags.full);
  for (const StressCase& one : cases) {
    const StressOutcome outcome =
        calib::run_stress_case(one, size, [] { return !player::interrupted(); });
    if (player::interrupted()) return player::interrupt_exit_code();
    const StressLimits limits = calib::limits_at(one, size);
    rows.push_back(json_of(one, limits, outcome));
    if (!flags.json) print_case(one, limits, outcome);
    flush_results();
    missed += outcome.held ? 0 : 1;
  }
  if (flags.json)
    print_json({{"machine", machine_json()}, {"full", flags.full}, {"cases", rows}});
  else
    print_out("\n{} cases, {} missed\n", rows.size(), missed);
  return missed == 0 ? kOk : kQuality;
}

}  // namespace lenticule::bench
