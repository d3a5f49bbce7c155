// SPDX-License-Identifier: Apache-2.0
// ProcedureState holds the values that a user of calibration by eye edits; the functions change
// them as one press of a key does.
#pragma once

#include <optional>
#include <string>

#include "calib/by_eye/sheet_values.h"
#include "optics/rig.h"

namespace lenticule::calib {

enum class Step {
  Prepare,        ///< distance, warm panel, unchanged pixels
  RoughPitch,     ///< questions: bands of different pitch
  Slant,          ///< questions: columns of different slant
  Ladders,        ///< questions: ladders, for pitch, slant and offset
  Offset,         ///< left eye red, right eye green
  Check,          ///< edges against centre, all keys at once
  GapByFlips,     ///< distance between positions with equal pictures
  GapByDistance,  ///< the pitch again, from another distance
  NumberedViews,  ///< number and order of the views seen
  Save,
};
inline constexpr int kSteps = 10;

/// Changes by one press of Stride::Normal.
inline constexpr double kPitchStep = 1e-4;  ///< fraction of the pitch
inline constexpr double kSlantStepDegrees = 0.01;
inline constexpr double kOffsetStepLenses = 0.01;
inline constexpr double kSpacingStepMm = 1.0;
inline constexpr double kDistanceStepMm = 10.0;

/// ProcedureState holds everything that undo restores.
struct ProcedureState {
  Step step = Step::Prepare;
  SheetValues sheet;
  double spacing_mm = 0.0;
  double second_distance_mm = 0.0;
  double second_pitch_subpx = 0.0;
  bool second_was_seen = false;  ///< else the second pitch is predicted from the gap
  bool gap_found = false;
};

/// FirstLook is the start of the procedure: the rig, and the distance from the panel to the eye.
struct FirstLook {
  optics::Rig rig;
  double distance_mm = 0.0;
};

/// Returns the values of the rig. The distance is one from which the rig can be viewed.
[[nodiscard]] ProcedureState first_state(const FirstLook& first);

/// Returns the rig with the values of a state.
[[nodiscard]] optics::Rig rig_of(const ProcedureState& state, const FirstLook& first);

/// Returns the problem of a state; empty if there is none. The rig must be valid at its viewing
/// line and at every eye position of the procedure.
[[nodiscard]] std::string problem_of(const ProcedureState& state, const FirstLook& first);

/// Predicts the pitch from the second distance from pitch and gap, unless the user has set it. A
/// change of the first pitch makes a new look from the second distance necessary.
void predict_second(ProcedureState& state, const FirstLook& first);

void change_slant(ProcedureState& state, double presses, const FirstLook& first);
void change_spacing(ProcedureState& state, double presses, const FirstLook& first);
/// Returns false, without a change, if the two distances would not determine the gap.
[[nodiscard]] bool change_second_distance(ProcedureState& state, double presses,
                                          const FirstLook& first);
/// Changes the second pitch. The picture from the first distance stays unchanged; the gap absorbs
/// the difference.
void change_second_pitch(ProcedureState& state, double presses, const FirstLook& first);
/// Swaps left and right eye by a shift of half a lens.
void turn_eyes(ProcedureState& state);

}  // namespace lenticule::calib
