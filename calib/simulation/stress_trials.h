// SPDX-License-Identifier: Apache-2.0
// The trials of the stress cases, grouped by the part under stress. Each function belongs to a line
// of the table in stress_cases.cpp.
#pragma once

#include "calib/simulation/stress_cases.h"

namespace lenticule::calib::stress {

/// Returns the starting point of all trials: three viewpoints, a usual webcam, one picture per
/// pattern.
[[nodiscard]] Trial base(StressSize size);
/// Returns a small version for another panel.
[[nodiscard]] Trial small_trial(int panel_width, int panel_height);

// Trials of the camera and its light.
[[nodiscard]] Trial noise_1(StressSize size);
[[nodiscard]] Trial noise_5(StressSize size);
[[nodiscard]] Trial low_resolution(StressSize size);
[[nodiscard]] Trial gamma(StressSize size);
[[nodiscard]] Trial gain_drift(StressSize size);
[[nodiscard]] Trial bands(StressSize size);
[[nodiscard]] Trial distortion(StressSize size);
[[nodiscard]] Trial oblique(StressSize size);
[[nodiscard]] Trial highlight(StressSize size);
[[nodiscard]] Trial jpeg_50(StressSize size);
[[nodiscard]] Trial shake(StressSize size);
[[nodiscard]] Trial single_photo(StressSize size);

// Trials of the starting values.
[[nodiscard]] Trial start_off(StressSize size);
[[nodiscard]] Trial alias_half(StressSize size);
[[nodiscard]] Trial alias_double(StressSize size);

// Trials of the link and the panel.
[[nodiscard]] Trial slow_panel(StressSize size);
[[nodiscard]] Trial chroma_420(StressSize size);
[[nodiscard]] Trial bgr(StressSize size);
[[nodiscard]] Trial pentile(StressSize size);
[[nodiscard]] Trial curved(StressSize size);

// Trials of the sheet.
[[nodiscard]] Trial deformed(StressSize size);
[[nodiscard]] Trial gap_bow(StressSize size);
[[nodiscard]] Trial bubbles(StressSize size);
[[nodiscard]] Trial vertical_6(StressSize size);
[[nodiscard]] Trial third_6(StressSize size);
[[nodiscard]] Trial wide_40(StressSize size);
[[nodiscard]] Trial fine_4(StressSize size);
[[nodiscard]] Trial warming(StressSize size);
[[nodiscard]] Trial lens_in(StressSize size);

}  // namespace lenticule::calib::stress
