// SPDX-License-Identifier: Apache-2.0
// A rig says where its numbers come from, and the rig from before is never lost: provenance
// entries, and copies beside the file.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "calib/calibration.h"
#include "calib/camera.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// What a calibration does not know about itself.
struct RecordDetails {
  std::chrono::system_clock::time_point when;
  std::string method;  ///< "camera", "photos", "one photograph", "by eye", "simulated"
  CameraFacts camera;  ///< empty names where there was none
  std::optional<double> temperature_celsius;
};

/// "2026-03-01T12:34:56Z".
[[nodiscard]] std::string iso_utc(std::chrono::system_clock::time_point when);

/// calibration.rig with provenance entries: date, tool, method, camera, panel, verdict,
/// viewpoints, residuals, standard errors. What the rig said before about its origin becomes one
/// entry "history_NUMBER", after the earlier ones; where there would be more entries than a rig
/// file holds, the oldest go and "history_dropped" counts them. Device names are made printable and
/// long texts are cut, so that the entries always fit into a rig file. Any thread.
[[nodiscard]] optics::Rig with_record(const Calibration& calibration, const RecordDetails& details);

/// Writes the rig to `file` in one step; if there is one, its bytes are first copied to
/// "STEM.NUMBER.toml" beside it, under a number higher than all before, and synchronised. Returns
/// the copy's path, empty if there was nothing to copy. Throws Error(Input) for a rig that could
/// not be read back or an old file that cannot be read, Error(Failed) if writing fails: then `file`
/// is as it was and there is no new copy. Two programs may do this at once: no copy overwrites
/// another.
[[nodiscard]] std::filesystem::path save_with_history(const optics::Rig& rig,
                                                      const std::filesystem::path& file);

}  // namespace lenticule::calib
