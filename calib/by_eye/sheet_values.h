// SPDX-License-Identifier: Apache-2.0
// A lens sheet as an eye at one distance finds it. What looks right from there is a pitch and an
// offset in effect; which pitch and which gap they are made of, the eye cannot tell. So these are
// what is edited, and the sheet follows: changing the gap leaves the picture for that eye as it is.
#pragma once

#include <string>

#include "optics/rig.h"

namespace lenticule::calib {

/// Formulas: paraxial, optics/effective_sheet.h. All from distance D on the rig's viewing height.
struct SheetValues {
  double effective_pitch_subpx = 0.0;    ///< P (1 + g / D)
  double slant = 0.0;                    ///< m; the same from everywhere
  double effective_offset_lenses = 0.0;  ///< the phase that the eye sees at the panel's centre
  double gap_mm = 0.0;                   ///< g
  friend bool operator==(const SheetValues&, const SheetValues&) = default;
};

/// The rig as seen from `distance_mm`, which is finite: its viewing distance is replaced.
[[nodiscard]] optics::Rig rig_seen_from(optics::Rig rig, double distance_mm);

[[nodiscard]] SheetValues sheet_values(const optics::Rig& rig, double distance_mm);

/// The rig with the sheet that looks so from `distance_mm`; all else, the viewing line too, as in
/// `rig`. The offset is within half a lens of 0.
[[nodiscard]] optics::Rig with_sheet_values(optics::Rig rig, const SheetValues& values,
                                            double distance_mm);

/// Why no sheet that was started from as `start` is likely to have these values: a pitch, slant or
/// gap too far from the start's, or a gap that makes no viewing cone a lens sheet has. One clause
/// with the value, the start's and what was expected; empty for values that are plausible.
[[nodiscard]] std::string doubt_of(const optics::Rig& rig, const SheetValues& start,
                                   const SheetValues& values);

/// The gap for which places of equal picture are `spacing_mm` apart for an eye at `distance_mm`,
/// one to either side of the middle: a lobe is p_h sqrt(D^2 + (1 - nu) (S/2)^2) / g wide.
[[nodiscard]] double gap_of_spacing(const optics::Rig& rig, const SheetValues& values,
                                    double distance_mm, double spacing_mm);
/// The reverse.
[[nodiscard]] double spacing_of_gap(const optics::Rig& rig, const SheetValues& values,
                                    double distance_mm);

/// The gap for which an eye at the second distance finds the second effective pitch:
/// P = (D2 P2 - D1 P1) / (D2 - D1), g = D1 (P1 - P) / P. May be absurd; the rig's validator knows.
[[nodiscard]] double gap_of_two_pitches(double distance_mm, double effective_pitch_subpx,
                                        double second_distance_mm, double second_pitch_subpx);

}  // namespace lenticule::calib
