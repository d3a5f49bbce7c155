// SPDX-License-Identifier: Apache-2.0
// lenticule bench calibrate calibrates sheets that only the simulation knows, and compares the
// results with this ground truth:
//
//   by default  random sheets before a camera on a tripod
//   --plain     the sheet of the sample rig, once; saves the rig and the pictures, for learning
//   --stress    cases with one disturbance each, which must be tolerated or named
//   --hand      random workshops with photographs that a phone takes by hand
//   --hand --wrong-ways   the same, with a mistake that people make in each calibration
//
// An accepted result that is wrong is a failure; a refused one is not.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/svg_plot.h"
#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "base/error.h"
#include "base/print.h"
#include "base/worker_threads.h"
#include "lab/panel/stress_cases.h"
#include "lab/panel/trial.h"
#include "lab/phone/hand_trial.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

namespace fs = std::filesystem;
using calib::Verdict;
using lab::HandOutcome;
using lab::StressCase;
using lab::StressDemand;
using lab::Trial;
using lab::TrialResult;
using lab::WrongWay;
using nlohmann::json;

struct CalibrateFlags {
  int draws = 10;
  uint64_t first = 1;
  int panel_width = 3840;
  int camera_width = 0;  ///< 0: the default of the kind of camera
  bool json = false;

  bool plain = false;  ///< one calibration of the sample rig's sheet
  double noise = 0.01;
  double deformation = 0.05;
  int viewpoints = 3;
  std::string pictures;
  std::string output;

  bool stress = false;
  bool full = false;
  std::string only;  ///< the name of one case; empty = all

  bool hand = false;
  std::vector<int> photographs = {1, 2, 3, 4, 6};
  std::optional<double> pitch_subpx;
  std::optional<double> warp_percent;
  std::string plot;
  std::string save;
  bool wrong_ways = false;
  bool sweep = false;
};

/// Error limit, in lenses, of a rig with verdict "intrinsic", at every place and for every eye of
/// the zone.
constexpr double kMostLenses = 0.02;

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

json json_of(uint64_t seed, const lab::Trial& trial, const lab::TrialResult& result) {
  const calib::Calibration& found = result.calibration;
  json out = {{"seed", seed},
              {"pitch_subpx", trial.sheet.pitch_subpx},
              {"slant", trial.sheet.slant},
              {"gap_mm", found.rig.sheet.gap.value},
              {"deformation_lenses", trial.sheet.deformation_lenses},
              {"noise", std::hypot(trial.camera.read_noise, trial.camera.shot_noise)},
              {"failure", result.failure},
              {"verdict", calib::to_string(found.verdict)},
              {"reasons", found.reasons},
              {"worst_lenses", result.errors.worst_lenses},
              {"rms_lenses", result.errors.rms_lenses},
              {"pitch_error", result.errors.pitch},
              {"slant_error", result.errors.slant},
              {"gap_error", result.errors.gap},
              {"map_rms_lenses", result.errors.map_rms_lenses},
              {"predicted_worst_lenses", found.drift.worst_lenses},
              {"effective_pitch_error", largest(result.errors.effective_pitch)},
              {"single_effective_pitch_error", largest(result.single.effective_pitch)},
              {"single_effective_slant_error", largest(result.single.effective_slant)},
              {"computing_seconds", found.seconds_computing},
              {"shown_seconds", result.shown_seconds},
              {"wall_seconds", result.wall_seconds}};
  for (const calib::Viewpoint& v : found.viewpoints)
    if (std::isfinite(v.predicted_lenses)) out["foretold_lenses"].push_back(v.predicted_lenses);
  for (const calib::Parameter& p : found.parameters) out["sigma"][p.name] = p.estimate.sigma;
  return out;
}

/// Returns "good", "refused" (or only effective, which refuses other eyes), or "WRONG".
const char* outcome_of(const json& draw) {
  const bool trusted = draw["failure"].get<std::string>().empty() &&
                       draw["verdict"] == calib::to_string(Verdict::Intrinsic);
  if (!trusted) return "refused";
  return draw["worst_lenses"].get<double>() <= kMostLenses ? "good" : "WRONG";
}

void print_draw(const json& draw) {
  const auto number = [&](const char* key) { return draw[key].get<double>(); };
  print_out(
      "{:>5} {:>7.3f} {:>8.4f} {:>6.3f} {:>5.3f} | {:<8} {:>7.4f} {:>8.1e} {:>8.1e} "
      "{:>8.1e} {:>7.4f} {:>8.1e} {:>6.1f}\n",
      draw["seed"].get<uint64_t>(), number("pitch_subpx"), number("slant"),
      number("deformation_lenses"), number("noise"), outcome_of(draw), number("worst_lenses"),
      number("pitch_error"), number("slant_error"), number("gap_error"), number("map_rms_lenses"),
      number("single_effective_pitch_error"), number("wall_seconds"));
  if (outcome_of(draw) == std::string("refused")) {
    const std::string failure = draw["failure"];
    print_out("      {}\n", failure.empty() && !draw["reasons"].empty()
                                ? draw["reasons"][0].get<std::string>()
                                : failure);
  }
}

/// Returns the root mean square of the errors of trusted draws, each divided by its own standard
/// error: 1 if the standard errors are correct. `scale` converts the reported error into the
/// number's unit.
template <class Scale>
json scatter(const json& draws, const char* error, const char* name, const Scale& scale) {
  double square = 0.0;
  int count = 0;
  for (const json& draw : draws) {
    if (outcome_of(draw) == std::string("refused")) continue;
    const double sigma = draw["sigma"].value(name, 0.0);
    if (!(sigma > 0.0)) continue;
    square += std::pow(draw[error].get<double>() * scale(draw) / sigma, 2);
    ++count;
  }
  return count > 0 ? json(std::sqrt(square / count)) : json();
}

json scatter_of(const json& draws) {
  const auto as_it_is = [](const json&) { return 1.0; };
  return {{"pitch", scatter(draws, "pitch_error", "pitch_subpx",
                            [](const json& draw) { return draw["pitch_subpx"].get<double>(); })},
          {"slant", scatter(draws, "slant_error", "slant", as_it_is)},
          {"gap", scatter(draws, "gap_error", "gap_mm",
                          [](const json& draw) { return draw["gap_mm"].get<double>(); })}};
}

json summary_of(const json& draws) {
  std::vector<double> worst, pitch, slant, gap, map, single, computing;
  int good = 0, wrong = 0;
  double shown = 0.0;
  for (const json& draw : draws) {
    good += outcome_of(draw) == std::string("good") ? 1 : 0;
    wrong += outcome_of(draw) == std::string("WRONG") ? 1 : 0;
    shown = std::max(shown, draw["shown_seconds"].get<double>());
    if (outcome_of(draw) == std::string("refused")) continue;
    worst.push_back(draw["worst_lenses"]);
    pitch.push_back(std::abs(draw["pitch_error"].get<double>()));
    slant.push_back(std::abs(draw["slant_error"].get<double>()));
    gap.push_back(std::abs(draw["gap_error"].get<double>()));
    map.push_back(draw["map_rms_lenses"]);
    single.push_back(draw["single_effective_pitch_error"]);
    computing.push_back(draw["computing_seconds"]);
  }
  json out = {{"draws", draws.size()},
              {"good", good},
              {"wrong", wrong},
              {"refused", draws.size() - static_cast<size_t>(good + wrong)},
              {"longest_capture_seconds", shown}};
  const auto spread = [&](const char* name, const std::vector<double>& values) {
    out[name] = {{"median", median(values)}, {"largest", largest(values)}};
  };
  spread("worst_lenses", worst);
  spread("pitch_error", pitch);
  spread("slant_error", slant);
  spread("gap_error", gap);
  spread("map_rms_lenses", map);
  spread("single_effective_pitch_error", single);
  spread("computing_seconds", computing);
  out["error_per_standard_error"] = scatter_of(draws);
  return out;
}

void print_summary(const json& summary) {
  print_out("\n{} draws: {} good, {} refused, {} wrong; longest capture of a viewpoint {:.1f} s\n",
            summary["draws"].get<int>(), summary["good"].get<int>(), summary["refused"].get<int>(),
            summary["wrong"].get<int>(), summary["longest_capture_seconds"].get<double>());
  print_out("{:<32} {:>10} {:>10}\n", "errors of trusted calibrations", "median", "largest");
  for (const auto& [key, value] : summary.items())
    if (value.is_object() && value.contains("median"))
      print_out("{:<32} {:>10.2g} {:>10.2g}\n", key, value["median"].get<double>(),
                value["largest"].get<double>());
  const json& scatter = summary["error_per_standard_error"];
  if (scatter["pitch"].is_number())
    print_out("errors in standard errors, rms: pitch {:.2f}, slant {:.2f}, gap {:.2f}\n",
              scatter["pitch"].get<double>(), scatter["slant"].get<double>(),
              scatter["gap"].get<double>());
}

Trial trial_of(const CalibrateFlags& flags, uint64_t seed) {
  const int panel_height = flags.panel_width * 9 / 16;
  const int camera_width = flags.camera_width > 0 ? flags.camera_width : 1920;
  const int camera_height = camera_width * 9 / 16;
  if (!flags.plain)
    return lab::random_trial(seed, flags.panel_width, panel_height, camera_width, camera_height);
  Trial trial = lab::plain_trial(flags.panel_width, panel_height, camera_width, camera_height);
  trial.seed = trial.sheet.seed = seed;
  trial.sheet.deformation_lenses = flags.deformation;
  trial.camera.read_noise = trial.camera.shot_noise = flags.noise / std::sqrt(2.0);
  trial.viewpoints.resize(static_cast<size_t>(flags.viewpoints));
  return trial;
}

/// Saves the rig with its report, as `lenticule calibrate` does.
ExitCode save_result(const CalibrateFlags& flags, const Trial& trial, const TrialResult& result) {
  if (!result.failure.empty()) throw Error(ErrorKind::Quality, result.failure);
  calib::RecordDetails details{.method = "simulated", .camera = {}};
  details.camera.name = "simulated camera";
  details.camera.width = trial.camera.width;
  details.camera.pixel_format = "simulated";
  tools::ResultFlags files;
  files.output = flags.output;
  files.json = flags.json;
  return tools::conclude_calibration(result.calibration, details, files,
                                     {{"ground_truth", json_of(flags.first, trial, result)}});
}

ExitCode run_calibrate_random(const CalibrateFlags& flags) {
  json draws = json::array();
  const bool listed = !flags.json;
  if (listed)
    print_out(
        "{}\n{:>5} {:>7} {:>8} {:>6} {:>5} | {:<8} {:>7} {:>8} {:>8} {:>8} {:>7} {:>8} "
        "{:>6}\n",
        machine_text(), "seed", "pitch", "slant", "bent", "noise", "outcome", "worst", "pitch",
        "slant", "gap", "map", "single", "s");
  ExitCode saved = kOk;
  for (int n = 0; n < (flags.plain ? 1 : flags.draws) && !player::interrupted(); ++n) {
    const uint64_t seed = flags.first + static_cast<uint64_t>(n);
    Trial trial = trial_of(flags, seed);
    trial.progress = [](size_t, int) { return !player::interrupted(); };
    if (!flags.pictures.empty()) {
      std::filesystem::create_directories(flags.pictures);
      trial.before_pattern = [&](lab::SimulatedBench& bench, size_t viewpoint, int pattern) {
        // The camera sees the previous pattern; before the first there is none.
        if (pattern > 0)
          tools::write_preview(bench.camera(),
                               fmt::format("{}/{}-{:03}.png", flags.pictures,
                                           trial.viewpoints[viewpoint].name, pattern - 1));
      };
    }
    const TrialResult result = lab::run_trial(trial);
    if (player::interrupted()) break;
    draws.push_back(json_of(seed, trial, result));
    if (listed) print_draw(draws.back());
    flush_results();
    if (!flags.output.empty()) saved = save_result(flags, trial, result);
  }
  if (player::interrupted()) return player::interrupt_exit_code();
  if (!flags.output.empty()) return saved;
  const json summary = summary_of(draws);
  if (flags.json)
    print_json({{"machine", machine_json()}, {"draws", draws}, {"summary", summary}});
  else if (!flags.plain)
    print_summary(summary);
  return summary["wrong"] == 0 ? kOk : kQuality;
}

// Stress cases.

std::vector<StressCase> chosen_cases(const std::string& name) {
  if (name.empty()) return lab::stress_cases();
  std::string known;
  for (const StressCase& one : lab::stress_cases()) {
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

json json_of(const StressCase& one, const lab::StressLimits& limits,
             const lab::StressOutcome& outcome) {
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

void print_case(const StressCase& one, const lab::StressLimits& limits,
                const lab::StressOutcome& outcome) {
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

ExitCode run_calibrate_stress(const CalibrateFlags& flags) {
  const std::vector<StressCase> cases = chosen_cases(flags.only);
  const lab::StressSize size = flags.full ? lab::StressSize::Full : lab::StressSize::Small;
  json rows = json::array();
  int missed = 0;
  if (!flags.json) print_head(flags.full);
  for (const StressCase& one : cases) {
    const lab::StressOutcome outcome =
        lab::run_stress_case(one, size, [] { return !player::interrupted(); });
    if (player::interrupted()) return player::interrupt_exit_code();
    const lab::StressLimits limits = lab::limits_at(one, size);
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

// Photographs by hand.

json json_of(uint64_t seed, const lab::Workshop& workshop, const lab::HandResult& result) {
  return {{"seed", seed},
          {"pitch_subpx", workshop.build.pitch_subpx},
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
  std::vector<double> errors, stated, ratios, accepted;
  int setups = 0, covered = 0, right = 0, wrong = 0;
  for (const json& row : rows) {
    if (row["photographs"] != photographs) continue;
    ++setups;
    right += row["outcome"] == to_string(HandOutcome::Right) ? 1 : 0;
    wrong += row["outcome"] == to_string(HandOutcome::Wrong) ? 1 : 0;
    if (!row["fitted"]) continue;
    errors.push_back(row["error_lenses"]);
    stated.push_back(row["stated_lenses"]);
    ratios.push_back(stated.back() / errors.back());
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
          {"stated_median", quantile(stated, 0.5)},
          {"stated_per_error_median", quantile(ratios, 0.5)}};
}

void print_hand_summary(const json& summary) {
  print_out("\n{:>11} {:>6} {:>6} {:>8} {:>6} | {:>7} {:>7} {:>9} | {:>7} {:>7} {:>9}\n",
            "photographs", "setups", "right", "refused", "wrong", "median", "95 %", "accepted",
            "stated", "ratio", "covered");
  for (const json& s : summary) {
    const auto number = [&](const char* key) { return s[key].get<double>(); };
    print_out(
        "{:>11} {:>6} {:>6} {:>8} {:>6} | {:>7.4f} {:>7.4f} {:>9.4f} | {:>7.4f} {:>7.2f} "
        "{:>4}/{:>4}\n",
        s["photographs"].get<int>(), s["setups"].get<int>(), s["right"].get<int>(),
        s["refused"].get<int>(), s["wrong"].get<int>(), number("error_median"), number("error_95"),
        number("accepted_error_largest"), number("stated_median"),
        number("stated_per_error_median"), s["covered"].get<int>(), s["fitted"].get<int>());
  }
}

void write_plot(const json& rows, const json& summary, const std::string& file) {
  Plot plot{.title = "hand-held photographs: error over the panel for eyes of the viewing zone",
            .x = {.label = "photographs", .scale = AxisScale::Linear},
            .y = {.label = "lenses", .scale = AxisScale::Log},
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

lab::WorkshopLimits limits_of(const CalibrateFlags& flags) {
  lab::WorkshopLimits limits =
      lab::limits_for(flags.panel_width, flags.camera_width > 0 ? flags.camera_width : 4000);
  constexpr int kPlacesOfSweep = 8;
  limits.shots = flags.sweep ? kPlacesOfSweep : *std::ranges::max_element(flags.photographs);
  if (flags.pitch_subpx) limits.least_pitch_subpx = limits.most_pitch_subpx = *flags.pitch_subpx;
  if (flags.warp_percent) limits.least_warp = limits.most_warp = *flags.warp_percent / 100.0;
  return limits;
}

/// Calls `draw` with the seed of each draw, in several threads, until the user interrupts. Helper
/// programs end at Ctrl-C, too: what a draw without them throws does not count.
template <class Draw>
void for_seeds(const CalibrateFlags& flags, const Draw& draw) {
  WorkerThreads(0).run(flags.draws, [&flags, &draw](int n, int /*worker*/) {
    if (player::interrupted()) return;
    try {
      draw(flags.first + static_cast<uint64_t>(n));
    } catch (const Error&) {
      if (!player::interrupted()) throw;
    }
  });
}

/// Returns the results in the order of their seeds.
json in_order(json rows) {
  std::ranges::stable_sort(rows.get_ref<json::array_t&>(), {},
                           [](const json& row) { return row["seed"].get<uint64_t>(); });
  return rows;
}

/// Returns how many results have each outcome.
std::string counts_of(const json& rows) {
  std::map<std::string, int> counts;
  for (const json& row : rows) ++counts[row["outcome"]];
  std::string out;
  for (const HandOutcome outcome : {HandOutcome::Right, HandOutcome::Refused, HandOutcome::Wrong})
    out += fmt::format("{}{} {}", out.empty() ? "" : ", ", counts[to_string(outcome)],
                       to_string(outcome));
  return out;
}

json results_of_hand(const CalibrateFlags& flags, uint64_t seed) {
  const fs::path pictures =
      flags.save.empty() ? fs::path() : fs::path(flags.save) / std::to_string(seed);
  json rows = json::array();
  if (flags.sweep) {
    const lab::SweepTrial trial(seed, limits_of(flags), pictures);
    rows.push_back(json_of(seed, trial.workshop(), trial.calibrate()));
    rows.back()["frames"] = std::exchange(rows.back()["photographs"], 1);
    return rows;
  }
  const lab::HandTrial trial(seed, limits_of(flags), pictures);
  for (const int count : flags.photographs)
    rows.push_back(json_of(seed, trial.workshop(), trial.calibrate(count)));
  return rows;
}

ExitCode run_calibrate_hand(const CalibrateFlags& flags) {
  json rows = json::array(), summary = json::array();
  if (!flags.json)
    print_out("{}\n{:>5} {:>7} {:>6} | {:<8} {:>7} {:>7}\n", machine_text(), "seed", "pitch",
              "photos", "outcome", "error", "stated");
  player::Progress progress("by hand", "setups", static_cast<uint64_t>(flags.draws), !flags.json);
  std::mutex mutex;
  uint64_t ended = 0;
  for_seeds(flags, [&](uint64_t seed) {
    const json results = results_of_hand(flags, seed);
    const std::lock_guard lock(mutex);
    for (const json& row : results) {
      rows.push_back(row);
      if (!flags.json) print_result(row);
    }
    flush_results();
    progress.update(++ended, counts_of(rows));
  });
  progress.finish(counts_of(rows));
  rows = in_order(std::move(rows));
  const std::vector<int> counts = flags.sweep ? std::vector<int>{1} : flags.photographs;
  for (const int count : counts) summary.push_back(summary_of(rows, count));
  if (!flags.plot.empty()) write_plot(rows, summary, flags.plot);
  if (flags.json)
    print_json({{"machine", machine_json()}, {"results", rows}, {"summary", summary}});
  else
    print_hand_summary(summary);
  if (player::interrupted()) return player::interrupt_exit_code();
  const bool wrong = std::ranges::any_of(summary, [](const json& s) { return s["wrong"] != 0; });
  return wrong ? kQuality : kOk;
}

// Mistakes with photographs.

/// Counts holds the outcomes of one mistake.
struct Counts {
  int right = 0;
  int refused = 0;  ///< the reason names the mistake
  int other = 0;    ///< refused for another reason
  int wrong = 0;
  std::map<std::string, int> blamed;  ///< other reasons, in a few words
  std::string other_reason;           ///< the last one

  void add(const lab::WrongWayResult& result) {
    if (result.outcome == lab::HandOutcome::Right) {
      ++right;
    } else if (result.outcome == lab::HandOutcome::Wrong) {
      ++wrong;
    } else if (result.cause_named) {
      ++refused;
    } else {
      ++other;
      ++blamed[result.blamed];
      other_reason = result.reason;
    }
  }
};

json json_of(uint64_t seed, const WrongWay& way, const lab::WrongWayResult& result) {
  return {{"seed", seed},
          {"mistake", way.name},
          {"outcome", to_string(result.outcome)},
          {"cause_named", result.cause_named},
          {"blamed", result.blamed},
          {"error_lenses", result.error_lenses},
          {"reason", result.reason}};
}

json json_of(const WrongWay& way, const Counts& counts) {
  return {{"mistake", way.name},
          {"right", counts.right},
          {"refused", counts.refused},
          {"other_reason", counts.other},
          {"wrong", counts.wrong},
          {"blamed_instead", counts.blamed},
          {"last_other_reason", counts.other_reason}};
}

void print_counts(std::span<const WrongWay> ways, const std::vector<Counts>& counts) {
  print_out("\n{:<40} {:>6} {:>6} {:>6} {:>6}  {}\n", "mistake", "right", "named", "other", "WRONG",
            "blamed instead");
  Counts sum;
  for (size_t k = 0; k < ways.size(); ++k) {
    std::string instead;
    for (const auto& [words, count] : counts[k].blamed)
      instead += fmt::format("{}{} {}", instead.empty() ? "" : ", ", words, count);
    print_out("{:<40} {:>6} {:>6} {:>6} {:>6}  {}\n", ways[k].name, counts[k].right,
              counts[k].refused, counts[k].other, counts[k].wrong, instead);
    sum.right += counts[k].right;
    sum.refused += counts[k].refused;
    sum.other += counts[k].other;
    sum.wrong += counts[k].wrong;
  }
  print_out("{:<40} {:>6} {:>6} {:>6} {:>6}  {:.0f} % of the refusals name the mistake\n", "all",
            sum.right, sum.refused, sum.other, sum.wrong,
            100.0 * sum.refused / std::max(sum.refused + sum.other, 1));
}

ExitCode run_calibrate_wrong(const CalibrateFlags& flags) {
  // A mistake is made in the last photograph; the first one alone would be without it.
  if (flags.photographs.size() != 1 || flags.photographs.front() < 2)
    throw Error(ErrorKind::Usage, "--photographs: --wrong-ways takes one number, 2 or more",
                "for example --photographs 4");
  const std::span<const WrongWay> ways = lab::wrong_ways();
  std::vector<Counts> counts(ways.size());
  lab::WorkshopLimits limits = limits_of(flags);
  limits.shots = flags.photographs.front();
  json rows = json::array(), summary = json::array();
  if (!flags.json) print_out("{}\n", machine_text());
  player::Progress progress("wrong ways", "calibrations",
                            static_cast<uint64_t>(flags.draws) * ways.size());
  std::mutex mutex;
  for_seeds(flags, [&](uint64_t seed) {
    lab::WrongWayTrial trial(seed, limits, std::filesystem::temp_directory_path());
    for (size_t k = 0; k < ways.size() && !player::interrupted(); ++k) {
      const lab::WrongWayResult result = trial.calibrate(ways[k]);
      const std::lock_guard lock(mutex);
      counts[k].add(result);
      rows.push_back(json_of(seed, ways[k], result));
      progress.update(rows.size(), counts_of(rows));
    }
  });
  progress.finish(counts_of(rows));
  rows = in_order(std::move(rows));
  for (size_t k = 0; k < ways.size(); ++k) summary.push_back(json_of(ways[k], counts[k]));
  if (flags.json)
    print_json({{"machine", machine_json()}, {"results", rows}, {"summary", summary}});
  else
    print_counts(ways, counts);
  if (player::interrupted()) return player::interrupt_exit_code();
  return std::ranges::any_of(counts, [](const Counts& c) { return c.wrong != 0; }) ? kQuality : kOk;
}

}  // namespace

cli::Run declare_bench_calibrate(CLI::App& app) {
  const auto flags = std::make_shared<CalibrateFlags>();
  app.footer(
      "Example:\n  lenticule bench calibrate --plain --noise 0.03 --deformation 0.1 -o sim.toml");
  app.add_option("--draws", flags->draws, "number of random sheets and cameras")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--first", flags->first, "seed of the first draw")->capture_default_str();
  app.add_option("--panel-width", flags->panel_width, "pixels; the height is 9/16 of it")
      ->check(CLI::Range(320, 15360))
      ->capture_default_str();
  app.add_option("--camera-width", flags->camera_width, "pixels; the height is 9/16 of it")
      ->check(CLI::Range(320, 7680))
      ->default_str("1920, of a phone 4000");

  CLI::Option* plain =
      app.add_flag("--plain", flags->plain,
                   "calibrate the sheet of the sample rig, once, instead of random ones");
  app.add_option("--noise", flags->noise, "noise of the camera, as a fraction of full scale")
      ->check(CLI::Range(0.0, 0.2))
      ->capture_default_str()
      ->needs(plain);
  app.add_option("--deformation", flags->deformation, "deformation of the sheet")
      ->type_name("LENSES")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str()
      ->needs(plain);
  app.add_option("--viewpoints", flags->viewpoints, "places of the camera")
      ->check(CLI::Range(1, 3))
      ->capture_default_str()
      ->needs(plain);
  app.add_option("--pictures", flags->pictures, "folder for the camera's picture of each pattern")
      ->type_name("FOLDER")
      ->needs(plain);
  app.add_option("-o,--output", flags->output, "save the rig, and a report beside it")
      ->type_name("RIG.toml")
      ->needs(plain);

  CLI::Option* stress = app.add_flag("--stress", flags->stress,
                                     "run the stress cases instead, each with one disturbance")
                            ->excludes(plain);
  app.add_flag("--full", flags->full,
               "run the stress cases at the size of real panels, which takes half an hour")
      ->needs(stress);
  app.add_option("--only", flags->only, "run only this stress case")->needs(stress);

  CLI::Option* hand =
      app.add_flag("--hand", flags->hand, "calibrate from photographs that a phone takes by hand")
          ->excludes(stress)
          ->excludes(plain);
  const CLI::Option* photographs =
      app.add_option("--photographs", flags->photographs,
                     "numbers of photographs to calibrate from, each once")
          ->delimiter(',')
          ->check(CLI::Range(1, 6))
          ->capture_default_str()
          ->needs(hand);
  app.add_option("--pitch", flags->pitch_subpx, "lens pitch of all sheets")
      ->type_name("SUBPIXELS")
      ->check(CLI::Range(2.0, 60.0))
      ->default_str("drawn: 4 to 11 on a panel of 3840 pixels, in proportion on smaller ones")
      ->needs(hand);
  app.add_option(
         "--warp", flags->warp_percent,
         "smooth displacement that the correction of the phone's lens leaves, rms in percent "
         "of the picture's width")
      ->type_name("PERCENT")
      ->check(CLI::Range(0.0, 1.0))
      ->default_str("0.01 to 0.05, as phones have it")
      ->needs(hand);
  app.add_option("--save", flags->save,
                 "folder in which the photographs of each setup, or the frames of its film, get a "
                 "folder, with the rig of their chart: to try lenticule calibrate photos on them")
      ->type_name("FOLDER")
      ->needs(hand);
  app.add_option("--plot", flags->plot, "SVG file: error against number of photographs")
      ->needs(hand);
  app.add_flag("--wrong-ways", flags->wrong_ways,
               "take photographs with each of 30 mistakes, such as a cropped file: three, or "
               "the one number of --photographs, 2 or more")
      ->needs(hand);
  app.add_flag(
         "--sweep", flags->sweep,
         "take one film with each phone, of which it uses some frames, instead of photographs")
      ->needs(hand)
      ->excludes("--photographs");
  app.add_flag("--json", flags->json, "print JSON");
  return [flags, photographs] {
    if (flags->stress) return run_calibrate_stress(*flags);
    if (!flags->hand) return run_calibrate_random(*flags);
    if (!flags->wrong_ways) return run_calibrate_hand(*flags);
    if (photographs->count() == 0) flags->photographs = {3};
    return run_calibrate_wrong(*flags);
  };
}

}  // namespace lenticule::bench
