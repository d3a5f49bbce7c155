// SPDX-License-Identifier: Apache-2.0
// SheetValues describes a lens sheet as seen by an eye at one distance. The eye sees an effective
// pitch and an effective offset, but cannot separate pitch and gap. Therefore the user edits the
// effective values, and the sheet is computed from them: changing the gap does not change the
// picture for that eye.
#pragma once

#include <string>

#include "optics/rig.h"

namespace lenticule::calib {

/// Formulas: paraxial, see optics/effective_sheet.h. All values are for distance D on the rig's
/// viewing height.
struct SheetValues {
  double effective_pitch_subpx = 0.0;    ///< P (1 + g / D)
  double slant = 0.0;                    ///< m; independent of the distance
  double effective_offset_lenses = 0.0;  ///< the phase that the eye sees at the panel's centre
  double gap_mm = 0.0;                   ///< g
  friend bool operator==(const SheetValues&, const SheetValues&) = default;
};

/// Returns the rig with its viewing distance replaced by `distance_mm`, which is finite.
[[nodiscard]] optics::Rig rig_seen_from(optics::Rig rig, double distance_mm);

[[nodiscard]] SheetValues sheet_values(const optics::Rig& rig, double distance_mm);

/// Returns the rig with the sheet that has these values from `distance_mm`; all else, including the
/// viewing line, stays as in `rig`. The offset is within half a lens of 0.
[[nodiscard]] optics::Rig with_sheet_values(optics::Rig rig, const SheetValues& values,
                                            double distance_mm);

/// Limits holds the largest differences between values and those of the start.
struct Limits {
  double pitch_ratio;
  double turn_degrees;
  double gap_ratio;
};
/// A start may be off by a tenth of the pitch, three degrees and a quarter of the gap; beyond these
/// limits the user has probably measured something else.
inline constexpr Limits kImplausible = {.pitch_ratio = 1.12, .turn_degrees = 5.0, .gap_ratio = 1.6};
/// Beyond these limits a user is asked. The data sheet of a lens sheet is usually closer.
inline constexpr Limits kSurprising = {.pitch_ratio = 1.035, .turn_degrees = 2.0, .gap_ratio = 1.4};

/// Returns the reason why these values are implausible for a sheet that started as `start`: a
/// pitch, slant or gap beyond the limits, or a gap whose viewing cone no lens sheet has. The reason
/// is one clause with the value, the start's value and the expected range; empty for plausible
/// values.
[[nodiscard]] std::string doubt_of(const optics::Rig& rig, const SheetValues& start,
                                   const SheetValues& values, const Limits& limits = kImplausible);

/// Returns the gap for which positions of equal picture are `spacing_mm` apart for an eye at
/// `distance_mm`, symmetric to the middle: a lobe is p_h sqrt(D^2 + (1 - nu) (S/2)^2) / g wide.
[[nodiscard]] double gap_of_spacing(const optics::Rig& rig, const SheetValues& values,
                                    double distance_mm, double spacing_mm);
/// Returns the spacing for the present gap (the inverse function).
[[nodiscard]] double spacing_of_gap(const optics::Rig& rig, const SheetValues& values,
                                    double distance_mm);

/// Returns the gap for which an eye at the second distance sees the second effective pitch: P = (D2
/// P2 - D1 P1) / (D2 - D1), g = D1 (P1 - P) / P. The result may be out of range; the rig's
/// validator checks it.
[[nodiscard]] double gap_of_two_pitches(double distance_mm, double effective_pitch_subpx,
                                        double second_distance_mm, double second_pitch_subpx);

}  // namespace lenticule::calib
