// SPDX-License-Identifier: Apache-2.0
// Explains a calibration to the user in plain text.
#pragma once

#include <string>
#include <vector>

#include "calib/calibration.h"

namespace lenticule::calib {

/// Targets of a calibration. The phase is in lenses.
inline constexpr double kWantedRmsLenses = 0.007;
inline constexpr double kWantedMaxLenses = 0.02;
inline constexpr double kWantedHeldOutMaxLenses = 0.05;
inline constexpr double kWantedPredictedLenses = 0.03;
inline constexpr double kWantedContrast = 0.25;

/// Returns the verdict as a headline.
[[nodiscard]] std::string verdict_headline(Verdict verdict);
/// Returns one or two sentences that explain the verdict.
[[nodiscard]] std::string verdict_explained(const Calibration& calibration);
/// Returns recommended actions, most important first; never empty.
[[nodiscard]] std::vector<std::string> advice(const Calibration& calibration);

/// Returns the position on the panel as seen from the front: "top left", "centre".
[[nodiscard]] std::string panel_place(const optics::Panel& panel, double x_px, double y_px);

/// Returns for example "7.701230 +- 0.000012", with two digits of the standard error; "not known"
/// for NaN.
[[nodiscard]] std::string with_error(const Estimate& estimate);

/// ResidualSummary is the root mean square and the largest of the residuals over the viewpoints
/// that the fit used (or, if `held_out`, did not use). NaN without such viewpoints.
struct ResidualSummary {
  int viewpoints = 0;
  double rms_lenses = 0.0;
  double max_lenses = 0.0;
};
[[nodiscard]] ResidualSummary residual_summary(const Calibration& calibration, bool held_out);

}  // namespace lenticule::calib
