// SPDX-License-Identifier: Apache-2.0
// A calibration for people: one page to read, print and keep.
#pragma once

#include <string>

#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::calib {

/// A whole HTML document: styles and pictures are inside, there are no scripts and no links, and
/// texts that came from devices are shown as they are. Never fails for what is in a calibration:
/// what is missing, not finite or of the wrong size is said to be not known. Any thread.
[[nodiscard]] std::string report_html(const Calibration& calibration, const RecordDetails& details);

}  // namespace lenticule::calib
