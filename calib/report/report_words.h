// SPDX-License-Identifier: Apache-2.0
// What a calibration means, in words for whoever stands in front of the panel.
#pragma once

#include <string>
#include <vector>

#include "calib/calibration.h"

namespace lenticule::calib {

/// What a calibration is measured by. The phase is in lenses.
inline constexpr double kWantedRmsLenses = 0.007;
inline constexpr double kWantedMaxLenses = 0.02;
inline constexpr double kWantedHeldOutMaxLenses = 0.05;
inline constexpr double kWantedForetoldLenses = 0.03;
inline constexpr double kWantedContrast = 0.25;

/// The verdict as a headline.
[[nodiscard]] std::string verdict_headline(Verdict verdict);
/// One or two sentences after it.
[[nodiscard]] std::string verdict_explained(const Calibration& calibration);
/// What to do now, most important first; never empty.
[[nodiscard]] std::vector<std::string> advice(const Calibration& calibration);

/// "top left", "centre": where on the panel, as seen from the front.
[[nodiscard]] std::string panel_place(const optics::Panel& panel, double x_px, double y_px);

/// "7.701230 +- 0.000012": as many digits as the standard error has two of; "not known" for NaN.
[[nodiscard]] std::string with_error(const Estimate& estimate);

/// Residuals over the viewpoints that the fit used (or, if `held_out`, that it did not): the
/// quadratic mean and the largest. NaN without such viewpoints.
struct ResidualSummary {
  int viewpoints = 0;
  double rms_lenses = 0.0;
  double max_lenses = 0.0;
};
[[nodiscard]] ResidualSummary residual_summary(const Calibration& calibration, bool held_out);

}  // namespace lenticule::calib
