// SPDX-License-Identifier: Apache-2.0
// Writes a calibration as one HTML page to read, print and keep.
#pragma once

#include <string>

#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::calib {

/// Returns a whole HTML document: styles and pictures are inside, without scripts and links, and
/// texts from devices are escaped. Never fails for the content of a calibration: values that are
/// missing, not finite or of the wrong size are shown as "not known".
///
/// Thread safety: any thread.
[[nodiscard]] std::string report_html(const Calibration& calibration, const RecordDetails& details);

}  // namespace lenticule::calib
