// SPDX-License-Identifier: Apache-2.0
// Records the origin of a rig's numbers as provenance entries.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "calib/calibration.h"
#include "calib/camera.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// RecordDetails holds facts that a calibration itself does not contain.
struct RecordDetails {
  std::chrono::system_clock::time_point when;
  std::string method;  ///< "camera", "photos", "one photograph", "by eye", "simulated"
  CameraFacts camera;  ///< empty name if there was no camera
  std::optional<double> temperature_celsius;
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

}  // namespace lenticule::calib
