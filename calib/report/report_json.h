// SPDX-License-Identifier: Apache-2.0
// Writes a calibration as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::calib {

/// Returns the whole calibration, under stable keys that name their units; numbers that are not
/// finite are null. Texts are printable UTF-8, so that dump() cannot fail.
///
/// Thread safety: any thread.
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration);

/// Returns the same JSON with "when", "method", "camera_used" and "temperature_celsius".
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration,
                                         const RecordDetails& details);

}  // namespace lenticule::calib
