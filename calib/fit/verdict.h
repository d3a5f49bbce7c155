// SPDX-License-Identifier: Apache-2.0
// Judges a calibration: collects the reasons that refuse it or restrict it to the measured eyes,
// and the warnings.
#pragma once

#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/fit/calibrate.h"
#include "calib/fit/fit_search.h"

namespace lenticule::calib {

/// Findings holds sentences for the user, each list in the order in which they were found.
struct Findings {
  std::vector<std::string> refusals;      ///< reasons why the calibration must not be used
  std::vector<std::string> restrictions;  ///< reasons why it is valid for the measured eyes only
  std::vector<std::string> warnings;      ///< notes that do not change the verdict
};

/// CalibrationEvidence holds the inputs of a judgement: the measurements, the fit and the described
/// result.
///
/// Lifetime: must not outlive the objects that it refers to.
struct CalibrationEvidence {
  const std::vector<ViewpointMeasurement>& measured;
  const FitProblem& problem;
  const FoundFit& found;  ///< has a fit
  const CalibrateOptions& options;
  const Calibration& result;  ///< all but verdict, reasons and warnings
};

/// Appends the findings about a calibration.
void judge(const CalibrationEvidence& evidence, Findings& findings);

/// Writes verdict, reasons and warnings into a calibration.
void put_verdict(Findings findings, Calibration& result);

/// Returns true if two values of one quantity agree within their standard errors.
[[nodiscard]] bool agree(const Estimate& a, const Estimate& b);

}  // namespace lenticule::calib
