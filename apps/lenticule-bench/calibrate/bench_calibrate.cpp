// SPDX-License-Identifier: Apache-2.0
// lenticule bench calibrate calibrates randomly drawn sheets on the simulated bench (panel and
// camera) and compares the results with the ground truth, which only the simulation knows.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/lenticule-bench/calibrate/bench_calibrate_hand.h"
#include "apps/lenticule-bench/calibrate/bench_calibrate_stress.h"
#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/simulation/trial.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"

namespace lenticule::bench {
namespace {

using calib::Trial;
using calib::TrialResult;
using calib::Verdict;
using nlohmann::json;

/// Error limit, in lenses, of a rig with verdict "intrinsic", at every place and for every eye of
/// the zone.
constexpr double kMostLenses = 0.02;

struct CalibrateFlags {
  int draws = 10;
  uint64_t first = 1;
  int panel_width = 3840;
  int panel_height = 2160;
  int camera_width = 1920;
  int camera_height = 1080;
  CalibrateStressFlags stress;
  bool by_hand = false;
  CalibrateHandFlags hand;
  bool json = false;
};

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

json json_of(uint64_t seed, const Trial& trial, const TrialResult& result) {
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

ExitCode run_calibrate_bench(const CalibrateFlags& flags) {
  json draws = json::array();
  if (!flags.json)
    print_out(
        "{}\n{:>5} {:>7} {:>8} {:>6} {:>5} | {:<8} {:>7} {:>8} {:>8} {:>8} {:>7} {:>8} "
        "{:>6}\n",
        machine_text(), "seed", "pitch", "slant", "bent", "noise", "outcome", "worst", "pitch",
        "slant", "gap", "map", "single", "s");
  for (int n = 0; n < flags.draws && !player::interrupted(); ++n) {
    const uint64_t seed = flags.first + static_cast<uint64_t>(n);
    Trial trial = calib::random_trial(seed, flags.panel_width, flags.panel_height,
                                      flags.camera_width, flags.camera_height);
    trial.progress = [](size_t, int) { return !player::interrupted(); };
    draws.push_back(json_of(seed, trial, calib::run_trial(trial)));
    if (player::interrupted()) break;
    if (!flags.json) print_draw(draws.back());
    flush_results();
  }
  const json summary = summary_of(draws);
  if (flags.json)
    print_json({{"machine", machine_json()}, {"draws", draws}, {"summary", summary}});
  else
    print_summary(summary);
  if (player::interrupted()) return player::interrupt_exit_code();
  return summary["wrong"] == 0 ? kOk : kQuality;
}

}  // namespace

cli::Run declare_bench_calibrate(CLI::App& app) {
  const auto flags = std::make_shared<CalibrateFlags>();
  app.add_option("--draws", flags->draws, "number of random sheets and cameras")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--first", flags->first, "seed of the first draw")->capture_default_str();
  app.add_option("--panel-width", flags->panel_width, "pixels; the height is 9/16 of it")
      ->check(CLI::Range(320, 15360))
      ->capture_default_str();
  app.add_option("--camera-width", flags->camera_width, "pixels; the height is 9/16 of it")
      ->check(CLI::Range(320, 7680))
      ->capture_default_str();
  CLI::Option* stress = app.add_flag("--stress", flags->stress.stress,
                                     "run the stress cases instead, each with one disturbance");
  app.add_flag("--full", flags->stress.full,
               "run the stress cases at the size of real panels, which takes half an hour")
      ->needs(stress);
  app.add_option("--only", flags->stress.only, "run only this stress case")->needs(stress);
  CLI::Option* hand =
      app.add_flag(
             "--hand", flags->by_hand,
             "calibrate from photographs that a phone takes by hand; --camera-width is that of "
             "its pictures, 4000 by default")
          ->excludes(stress);
  const CLI::Option* photographs =
      app.add_option("--photographs", flags->hand.photographs,
                     "numbers of photographs to calibrate from, each once")
          ->delimiter(',')
          ->check(CLI::Range(1, 6))
          ->capture_default_str()
          ->needs(hand);
  app.add_option("--plot", flags->hand.plot, "SVG file: error against number of photographs")
      ->needs(hand);
  app.add_flag(
         "--wrong-ways", flags->hand.wrong_ways,
         "take photographs with each of two dozen mistakes, such as a cropped file: three, or "
         "the one number of --photographs, 2 or more")
      ->needs(hand);
  app.add_flag("--json", flags->json, "print JSON");
  const CLI::Option* camera = app.get_option("--camera-width");
  return [flags, camera, photographs] {
    if (flags->by_hand) {
      if (flags->hand.wrong_ways && photographs->count() == 0) flags->hand.photographs = {3};
      flags->hand.draws = flags->draws;
      flags->hand.first = flags->first;
      flags->hand.panel_width = flags->panel_width;
      if (camera->count() > 0) flags->hand.phone_width = flags->camera_width;
      flags->hand.json = flags->json;
      return flags->hand.wrong_ways ? run_calibrate_wrong(flags->hand)
                                    : run_calibrate_hand(flags->hand);
    }
    flags->stress.json = flags->json;
    if (flags->stress.stress) return run_calibrate_stress(flags->stress);
    flags->panel_height = flags->panel_width * 9 / 16;
    flags->camera_height = flags->camera_width * 9 / 16;
    return run_calibrate_bench(*flags);
  };
}

}  // namespace lenticule::bench
