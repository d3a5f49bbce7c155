// SPDX-License-Identifier: Apache-2.0
// Explains a calibration to the user: in sentences, as JSON, and as a page to read, print and keep.
#pragma once

#include <chrono>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/calibration.h"
#include "calib/camera.h"
#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// RecordDetails holds facts that a calibration itself does not contain.
struct RecordDetails {
  std::chrono::system_clock::time_point when = std::chrono::system_clock::now();
  std::string method;  ///< "camera", "photos", "one photograph", "by eye", "simulated"
  CameraFacts camera;  ///< empty name if there was no camera
  std::optional<double> temperature_celsius{};
};

/// Returns for example "2026-03-01T12:34:56Z".
[[nodiscard]] std::string iso_utc(std::chrono::system_clock::time_point when);

/// Returns calibration.rig with provenance entries: date, tool, method, camera, panel, verdict,
/// viewpoints, residuals, standard errors. The rig's previous provenance becomes one entry
/// "history_NUMBER" after the earlier ones; if there would be more entries than a rig file may
/// hold, the oldest are removed and "history_dropped" counts them. Device names are made printable
/// and long texts are cut, so that the entries always fit into a rig file.
///
/// Thread safety: any thread.
[[nodiscard]] optics::Rig with_record(const Calibration& calibration, const RecordDetails& details);

/// Returns the verdict as a headline.
[[nodiscard]] std::string verdict_headline(Verdict verdict);
/// Returns one or two sentences that explain the verdict.
[[nodiscard]] std::string verdict_explained(const Calibration& calibration);
/// Returns recommended actions, most important first; never empty.
[[nodiscard]] std::vector<std::string> advice(const Calibration& calibration);

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

/// Sensitivity tells how far the picture moves when the seat, the room's temperature or a value of
/// the rig changes.
struct Sensitivity {
  std::string change;         ///< "1 K warmer"
  double worst_lenses = 0.0;  ///< largest change of the phase over the panel
  /// Amount of the change that gives 0.02 lens, which is hardly visible, with its unit: "0.37 K".
  /// Proportional.
  std::string allowed;
};

/// Returns the effects of small changes of seat, temperature and rig on the phase that an eye at
/// `eye` sees, the largest over a grid that includes the panel's border. They are differences of
/// the exact model; pitch and slant pivot at the panel's centre. `eye.z_mm` is positive and finite.
/// Throws the Error(Input) of OpticalModel.
[[nodiscard]] std::vector<Sensitivity> sensitivities(const optics::Rig& rig,
                                                     const optics::Eye& eye);

/// Returns the whole calibration, under stable keys that name their units; numbers that are not
/// finite are null. Texts are printable UTF-8, so that dump() cannot fail.
///
/// Thread safety: any thread.
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration);

/// Returns the same JSON with "when", "method", "camera_used" and "temperature_celsius".
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration,
                                         const RecordDetails& details);

/// Returns a whole HTML document that draws the calibration by its own script; it needs no network
/// and no other file. Never fails for the content of a calibration: values that are missing, not
/// finite or of the wrong size are shown as "not known", and texts from devices as text.
///
/// Thread safety: any thread.
[[nodiscard]] std::string report_html(const Calibration& calibration, const RecordDetails& details);

/// Returns report.html, which this library contains; "@DATA@" is the place of the data.
[[nodiscard]] std::string_view report_page();

}  // namespace lenticule::calib
