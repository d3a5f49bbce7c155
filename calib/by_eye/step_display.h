// SPDX-License-Identifier: Apache-2.0
// Selects the chart pattern of a step, and writes the values that a step edits as text.
#pragma once

#include <string>

#include "calib/by_eye/procedure_state.h"
#include "frames/charts/chart.h"

namespace lenticule::calib {

/// Returns the pattern of a step; with `other`, its second one, if it has two.
[[nodiscard]] frames::ChartPattern pattern_of_step(Step step, bool other);

/// Returns the values of the sheet: "effective pitch 7.7010 (pitch ...), slant ..., gap ... mm".
[[nodiscard]] std::string sheet_numbers(const ProcedureState& state, const FirstLook& first);

/// Returns the place of the mark: "band 3 of 25", or "none of them" for a place beyond either end.
[[nodiscard]] std::string mark_text(int cursor);

}  // namespace lenticule::calib
