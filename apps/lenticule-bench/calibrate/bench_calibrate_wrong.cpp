// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <memory>

#include "apps/lenticule-bench/calibrate/bench_calibrate_hand.h"
#include "apps/lenticule-bench/calibrate/wrong_ways.h"
#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

using nlohmann::json;

/// Counts holds the outcomes of one mistake.
struct Counts {
  int right = 0;
  int refused = 0;  ///< the reason names the mistake
  int other = 0;    ///< refused for another reason
  int wrong = 0;
  std::string other_reason;  ///< the last one

  void add(const WrongWayResult& result) {
    if (result.outcome == HandOutcome::Right) {
      ++right;
    } else if (result.outcome == HandOutcome::Wrong) {
      ++wrong;
    } else if (result.cause_named) {
      ++refused;
    } else {
      ++other;
      other_reason = result.reason;
    }
  }
};

json json_of(uint64_t seed, const WrongWay& way, const WrongWayResult& result) {
  return {{"seed", seed},
          {"mistake", way.name},
          {"outcome", to_string(result.outcome)},
          {"cause_named", result.cause_named},
          {"error_lenses", result.error_lenses},
          {"reason", result.reason}};
}

json json_of(const WrongWay& way, const Counts& counts) {
  return {{"mistake", way.name},       {"right", counts.right},
          {"refused", counts.refused}, {"other_reason", counts.other},
          {"wrong", counts.wrong},     {"last_other_reason", counts.other_reason}};
}

void print_counts(std::span<const WrongWay> ways, const std::vector<Counts>& counts) {
  print_out("\n{:<40} {:>6} {:>8} {:>6} {:>6}  {}\n", "mistake", "right", "refused", "other",
            "WRONG", "other reason");
  for (size_t k = 0; k < ways.size(); ++k)
    print_out("{:<40} {:>6} {:>8} {:>6} {:>6}  {}\n", ways[k].name, counts[k].right,
              counts[k].refused, counts[k].other, counts[k].wrong, counts[k].other_reason);
}

}  // namespace

ExitCode run_calibrate_wrong(const CalibrateHandFlags& flags) {
  // A mistake is made in the last photograph; the first one alone would be without it.
  if (flags.photographs.size() != 1 || flags.photographs.front() < 2)
    throw Error(ErrorKind::Usage, "--photographs: --wrong-ways takes one number, 2 or more",
                "for example --photographs 4");
  const std::span<const WrongWay> ways = wrong_ways();
  std::vector<Counts> counts(ways.size());
  WorkshopLimits limits = limits_of(flags);
  limits.shots = flags.photographs.front();
  json rows = json::array(), summary = json::array();
  if (!flags.json) print_out("{}\n", machine_text());
  player::Progress progress("wrong ways", "calibrations",
                            static_cast<uint64_t>(flags.draws) * ways.size(),
                            flags.json ? player::ProgressStyle::Off : player::ProgressStyle::Auto);
  for (int n = 0; n < flags.draws && !player::interrupted(); ++n) {
    const uint64_t seed = flags.first + static_cast<uint64_t>(n);
    WrongWayTrial trial(seed, limits, std::filesystem::temp_directory_path());
    for (size_t k = 0; k < ways.size() && !player::interrupted(); ++k) {
      const WrongWayResult result = trial.calibrate(ways[k]);
      counts[k].add(result);
      rows.push_back(json_of(seed, ways[k], result));
      progress.update(rows.size());
    }
  }
  progress.finish();
  for (size_t k = 0; k < ways.size(); ++k) summary.push_back(json_of(ways[k], counts[k]));
  if (flags.json)
    print_json({{"machine", machine_json()}, {"results", rows}, {"summary", summary}});
  else
    print_counts(ways, counts);
  if (player::interrupted()) return player::interrupt_exit_code();
  return std::ranges::any_of(counts, [](const Counts& c) { return c.wrong != 0; }) ? kQuality : kOk;
}

}  // namespace lenticule::bench
