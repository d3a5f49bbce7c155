// SPDX-License-Identifier: Apache-2.0
// Runs a stress case and evaluates its result.
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "calib/photo/single_photo.h"
#include "calib/simulation/stress_cases.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

/// Limit of every trusted rig, independent of the case's own limits.
constexpr double kMostLenses = 0.02;
/// Part of the warning that something moved during the measurement.
constexpr const char* kMoved = "something moved";
/// Pictures until the panel has settled.
constexpr int kSettlePictures = 6;

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

std::string everything_said(const TrialResult& result) {
  std::string said = result.failure;
  const auto add = [&](const std::vector<std::string>& sentences) {
    for (const std::string& s : sentences) said += (said.empty() ? "" : "; ") + s;
  };
  add(result.calibration.reasons);
  add(result.calibration.warnings);
  add(result.calibration.link.findings);
  return said;
}

CameraPicture settled_picture(SimulatedBench& bench) {
  CameraPicture picture;
  for (int n = 0; n < kSettlePictures; ++n)
    if (bench.camera().grab(picture, std::chrono::seconds(10)) != GrabStatus::Ready)
      throw Error(ErrorKind::Device, "camera: no picture");
  return picture;
}

/// Calibrates with the chart and a measured distance instead of patterns.
TrialResult run_photo(const Trial& trial) {
  TrialResult result;
  try {
    SimulatedBench bench(trial.panel, trial.sheet, trial.link, trial.camera, trial.seed);
    const TrialViewpoint& place = trial.viewpoints.front();
    bench.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    const SinglePhotoChart chart = plan_single_photo_chart(trial.start);
    const frames::WovenFrame frame = draw_single_photo_chart(chart);
    if (bench.sink().show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
      throw Error(ErrorKind::Device, "display: the chart is not shown");
    PhotoPriors tape;
    tape.distance_mm = Estimate{place.position_mm.z, 3.0};
    result.calibration = fit_single_photo(settled_picture(bench), chart, tape);
    evaluate_trial(trial, bench, result);
  } catch (const Error& error) {
    result.failure = error.what();
  }
  return result;
}

bool within(const StressLimits& limits, const StressOutcome& outcome) {
  return outcome.flat_lenses <= limits.flat_lenses &&
         outcome.errors.worst_lenses <= limits.worst_lenses && outcome.pitch <= limits.pitch &&
         outcome.errors.map_rms_lenses <= limits.map_rms_lenses;
}

/// Returns true if a trusted result is wrong. An intrinsic rig is for every eye of the zone, an
/// effective one for the viewpoints. The comparison is not <=, so that NaN counts as wrong.
bool misleads(Verdict verdict, const StressOutcome& outcome) {
  const TrialErrors& errors = outcome.errors;
  if (verdict == Verdict::Refused) return false;
  if (verdict == Verdict::Effective) {
    const bool warned = outcome.said.find(kMoved) != std::string::npos;
    return !warned && !(largest(errors.flat_lenses) <= kMostLenses);
  }
  return !(errors.worst_lenses <= kMostLenses);
}

double first_of(const std::vector<double>& values) {
  return values.empty() ? 0.0 : std::abs(values.front());
}

bool meets(const StressCase& one, const StressOutcome& outcome) {
  if (outcome.wrong) return false;
  switch (one.demand) {
    case StressDemand::Good:
      return outcome.good;
    case StressDemand::Detected:
      return outcome.named;
    case StressDemand::GoodOrDetected:
      return outcome.good || outcome.verdict != to_string(Verdict::Intrinsic);
  }
  return false;
}

void evaluate(const StressCase& one, const StressLimits& limits, const TrialResult& result,
              StressOutcome& outcome) {
  const Verdict verdict = result.calibration.verdict;
  outcome.measured = result.failure.empty() && !result.calibration.viewpoints.empty();
  outcome.verdict = result.failure.empty() ? to_string(verdict) : "failed";
  outcome.said = everything_said(result);
  outcome.errors = result.errors;
  outcome.pitch = first_of(result.errors.effective_pitch);
  outcome.flat_lenses = first_of(result.errors.flat_lenses);
  outcome.named = !one.named_by.empty() && outcome.said.find(one.named_by) != std::string::npos;
  const Verdict wanted = one.single_photo ? Verdict::Effective : Verdict::Intrinsic;
  outcome.good = outcome.measured && verdict == wanted && within(limits, outcome);
  outcome.wrong = outcome.measured && misleads(verdict, outcome);
  outcome.held = meets(one, outcome);
}

}  // namespace

StressOutcome run_stress_case(const StressCase& one, StressSize size,
                              const std::function<bool()>& may_continue) {
  const auto begin = std::chrono::steady_clock::now();
  Trial trial = one.trial(size);
  trial.progress = [&](size_t, int) { return !may_continue || may_continue(); };
  StressOutcome outcome;
  evaluate(one, limits_at(one, size), one.single_photo ? run_photo(trial) : run_trial(trial),
           outcome);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  outcome.seconds = elapsed.count();
  return outcome;
}

}  // namespace lenticule::calib
