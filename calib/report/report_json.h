// SPDX-License-Identifier: Apache-2.0
// A calibration for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::calib {

/// Everything in it, under keys that name their units and will not change; numbers that are not
/// finite are null. Texts are printable UTF-8, so that dump() cannot fail. Any thread.
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration);

/// The same with "when", "method", "camera_used" and "temperature_celsius".
[[nodiscard]] nlohmann::json report_json(const Calibration& calibration,
                                         const RecordDetails& details);

}  // namespace lenticule::calib
