// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/step_display.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace lenticule::calib {
namespace {

using frames::ChartPattern;
using frames::kBands;

double degrees(double slant, const optics::Panel& panel) {
  return std::atan(slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
         std::numbers::pi;
}

}  // namespace

ChartPattern pattern_of_step(Step step, bool other) {
  switch (step) {
    case Step::Prepare:
      return ChartPattern::PixelLines;
    case Step::RoughPitch:
      return ChartPattern::Bands;
    case Step::Slant:
    case Step::Pitch:
    case Step::GapByDistance:
      return other ? ChartPattern::TwoViews : ChartPattern::Comb;
    case Step::Offset:
    case Step::Check:
    case Step::GapByFlips:
      return other ? ChartPattern::Comb : ChartPattern::TwoViews;
    default:
      return other ? ChartPattern::TwoViews : ChartPattern::NumberedViews;
  }
}

std::string sheet_numbers(const ProcedureState& state, const FirstLook& first) {
  const optics::Rig rig = rig_of(state, first);
  return fmt::format(
      "effective pitch {:.6f} (pitch {:.6f}), slant {:.4f} degrees, offset {:.4f}, gap {:.4f} mm",
      state.sheet.effective_pitch_subpx, rig.sheet.pitch.value, degrees(rig.sheet.slant, rig.panel),
      rig.sheet.offset.value, state.sheet.gap_mm);
}

std::string mark_text(int cursor) {
  return cursor < 0 || cursor >= kBands ? std::string("none of them")
                                        : fmt::format("band {} of {}", cursor + 1, kBands);
}

}  // namespace lenticule::calib
