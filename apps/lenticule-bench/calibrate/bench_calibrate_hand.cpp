// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/calibrate/bench_calibrate_hand.h"

#include <algorithm>

#include "apps/lenticule-bench/calibrate/hand_trial.h"
#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-tools/cli/svg_plot.h"
#include "base/print.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

using tools::PlotSeries;

using nlohmann::json;

json json_of(uint64_t seed, const HandTrial& trial, const HandResult& result) {
  return {{"seed", seed},
          {"pitch_subpx", trial.workshop().build.pitch_subpx},
          {"photographs", result.photographs},
          {"outcome", to_string(result.outcome)},
          {"fitted", result.fitted},
          {"error_lenses", result.error_lenses},
          {"stated_lenses", result.stated_lenses},
          {"reasons", result.reasons},
          {"fit_seconds", result.fit_seconds}};
}

void print_result(const json& row) {
  print_out("{:>5} {:>7.3f} {:>6} | {:<8}", row["seed"].get<uint64_t>(),
            row["pitch_subpx"].get<double>(), row["photographs"].get<int>(),
            row["outcome"].get<std::string>());
  if (row["fitted"])
    print_out(" {:>7.4f} {:>7.4f}", row["error_lenses"].get<double>(),
              row["stated_lenses"].get<double>());
  else
    print_out(" {:>7} {:>7}", "-", "-");
  print_out("  {}\n",
            row["reasons"].empty() ? std::string() : row["reasons"][0].get<std::string>());
}

/// Returns the summary of all results with one number of photographs.
json summary_of(const json& rows, int photographs) {
  std::vector<double> errors, stated, accepted;
  int setups = 0, covered = 0, right = 0, wrong = 0;
  for (const json& row : rows) {
    if (row["photographs"] != photographs) continue;
    ++setups;
    right += row["outcome"] == to_string(HandOutcome::Right) ? 1 : 0;
    wrong += row["outcome"] == to_string(HandOutcome::Wrong) ? 1 : 0;
    if (!row["fitted"]) continue;
    errors.push_back(row["error_lenses"]);
    stated.push_back(row["stated_lenses"]);
    covered += errors.back() <= stated.back() ? 1 : 0;
    if (row["outcome"] != to_string(HandOutcome::Refused)) accepted.push_back(errors.back());
  }
  return {{"photographs", photographs},
          {"setups", setups},
          {"right", right},
          {"refused", setups - right - wrong},
          {"wrong", wrong},
          {"fitted", errors.size()},
          {"covered", covered},
          {"error_median", quantile(errors, 0.5)},
          {"error_95", quantile(errors, 0.95)},
          {"accepted_error_largest", quantile(accepted, 1.0)},
          {"stated_median", quantile(stated, 0.5)}};
}

void print_summary(const json& summary) {
  print_out("\n{:>11} {:>6} {:>6} {:>8} {:>6} | {:>7} {:>7} {:>7} {:>9} | {:>9}\n", "photographs",
            "setups", "right", "refused", "wrong", "median", "95 %", "stated", "accepted",
            "covered");
  for (const json& s : summary)
    print_out(
        "{:>11} {:>6} {:>6} {:>8} {:>6} | {:>7.4f} {:>7.4f} {:>7.4f} {:>9.4f} | {:>4}/{:>4}\n",
        s["photographs"].get<int>(), s["setups"].get<int>(), s["right"].get<int>(),
        s["refused"].get<int>(), s["wrong"].get<int>(), s["error_median"].get<double>(),
        s["error_95"].get<double>(), s["stated_median"].get<double>(),
        s["accepted_error_largest"].get<double>(), s["covered"].get<int>(), s["fitted"].get<int>());
}

void write_plot(const json& rows, const json& summary, const std::string& file) {
  tools::Plot plot{
      .title = "hand-held photographs: error over the panel for eyes of the viewing zone",
      .x = {.label = "photographs", .scale = tools::AxisScale::Linear},
      .y = {.label = "lenses", .scale = tools::AxisScale::Log},
      .series = {}};
  PlotSeries accepted{.label = "accepted", .points = {}, .joined = false};
  PlotSeries refused{.label = "refused", .points = {}, .joined = false};
  PlotSeries median{.label = "median", .points = {}}, stated{.label = "stated", .points = {}};
  constexpr double kAside = 0.08;
  for (const json& row : rows) {
    if (!row["fitted"]) continue;
    const bool out = row["outcome"] == to_string(HandOutcome::Refused);
    (out ? refused : accepted)
        .points.push_back({row["photographs"].get<double>() + (out ? kAside : -kAside),
                           std::max(row["error_lenses"].get<double>(), 1e-4)});
  }
  for (const json& s : summary) {
    if (s["fitted"] == 0) continue;
    median.points.push_back({s["photographs"].get<double>(), s["error_median"].get<double>()});
    stated.points.push_back({s["photographs"].get<double>(), s["stated_median"].get<double>()});
  }
  for (PlotSeries* series : {&accepted, &refused, &median, &stated})
    if (!series->points.empty()) plot.series.push_back(std::move(*series));
  if (!plot.series.empty()) write_svg(plot, file);
}

}  // namespace

WorkshopLimits limits_of(const CalibrateHandFlags& flags) {
  WorkshopLimits limits = limits_for(flags.panel_width, flags.phone_width);
  limits.shots = *std::ranges::max_element(flags.photographs);
  return limits;
}

ExitCode run_calibrate_hand(const CalibrateHandFlags& flags) {
  json rows = json::array(), summary = json::array();
  if (!flags.json)
    print_out("{}\n{:>5} {:>7} {:>6} | {:<8} {:>7} {:>7}\n", machine_text(), "seed", "pitch",
              "photos", "outcome", "error", "stated");
  for (int n = 0; n < flags.draws && !player::interrupted(); ++n) {
    const uint64_t seed = flags.first + static_cast<uint64_t>(n);
    const HandTrial trial(seed, limits_of(flags));
    for (const int count : flags.photographs) {
      rows.push_back(json_of(seed, trial, trial.calibrate(count)));
      if (!flags.json) print_result(rows.back());
    }
    flush_results();
  }
  for (const int count : flags.photographs) summary.push_back(summary_of(rows, count));
  if (!flags.plot.empty()) write_plot(rows, summary, flags.plot);
  if (flags.json)
    print_json({{"machine", machine_json()}, {"results", rows}, {"summary", summary}});
  else
    print_summary(summary);
  if (player::interrupted()) return player::interrupt_exit_code();
  const bool wrong = std::ranges::any_of(summary, [](const json& s) { return s["wrong"] != 0; });
  return wrong ? kQuality : kOk;
}

}  // namespace lenticule::bench
