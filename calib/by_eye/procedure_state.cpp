// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/procedure_state.h"

#include <algorithm>
#include <numbers>

namespace lenticule::calib {
namespace {

/// Two distances with a smaller ratio do not determine the gap.
constexpr double kLeastDistanceRatio = 1.05;
constexpr double kFirstSecondDistance = 1.5;

double slant_step(const optics::Panel& panel) {
  return kSlantStepDegrees * std::numbers::pi / 180.0 * panel.pixel_height.value /
         panel.pixel_width.value;
}

double gap_of_pitches(const ProcedureState& state, const FirstLook& first) {
  return gap_of_two_pitches(first.distance_mm, state.sheet.effective_pitch_subpx,
                            state.second_distance_mm, state.second_pitch_subpx);
}

}  // namespace

ProcedureState first_state(const FirstLook& first) {
  ProcedureState state;
  state.sheet = sheet_values(first.rig, first.distance_mm);
  state.spacing_mm = spacing_of_gap(first.rig, state.sheet, first.distance_mm);
  state.second_distance_mm = kFirstSecondDistance * first.distance_mm;
  predict_second(state, first);
  return state;
}

optics::Rig rig_of(const ProcedureState& state, const FirstLook& first) {
  return with_sheet_values(first.rig, state.sheet, first.distance_mm);
}

std::string problem_of(const ProcedureState& state, const FirstLook& first) {
  const optics::Rig rig = rig_of(state, first);
  for (const optics::Rig& seen :
       {rig_seen_from(rig, first.distance_mm), rig, rig_seen_from(rig, state.second_distance_mm)})
    if (const auto problem = optics::find_problem(seen))
      return problem->key + ": " + problem->cause;
  return "";
}

void predict_second(ProcedureState& state, const FirstLook& first) {
  if (state.second_was_seen && state.step == Step::GapByDistance) return;
  state.second_was_seen = false;
  const double pitch =
      state.sheet.effective_pitch_subpx / (1.0 + state.sheet.gap_mm / first.distance_mm);
  state.second_pitch_subpx = pitch * (1.0 + state.sheet.gap_mm / state.second_distance_mm);
}

void change_slant(ProcedureState& state, double presses, const FirstLook& first) {
  state.sheet.slant += presses * slant_step(first.rig.panel);
}

void change_spacing(ProcedureState& state, double presses, const FirstLook& first) {
  state.spacing_mm = std::max(1.0, state.spacing_mm + presses * kSpacingStepMm);
  state.sheet.gap_mm = gap_of_spacing(first.rig, state.sheet, first.distance_mm, state.spacing_mm);
  state.gap_found = true;
  state.second_was_seen = false;
  predict_second(state, first);
}

bool change_second_distance(ProcedureState& state, double presses, const FirstLook& first) {
  const double distance_mm = state.second_distance_mm + presses * kDistanceStepMm;
  const double ratio = distance_mm / first.distance_mm;
  if (!(ratio > kLeastDistanceRatio || (ratio > 0.0 && ratio < 1.0 / kLeastDistanceRatio)))
    return false;
  state.second_distance_mm = distance_mm;
  predict_second(state, first);
  if (state.second_was_seen) state.sheet.gap_mm = gap_of_pitches(state, first);
  return true;
}

void change_second_pitch(ProcedureState& state, double presses, const FirstLook& first) {
  state.second_pitch_subpx *= 1.0 + presses * kPitchStep;
  state.second_was_seen = true;
  state.gap_found = true;
  state.sheet.gap_mm = gap_of_pitches(state, first);
  if (state.sheet.gap_mm > 0.0)
    state.spacing_mm = spacing_of_gap(first.rig, state.sheet, first.distance_mm);
}

void turn_eyes(ProcedureState& state) {
  const double offset = state.sheet.effective_offset_lenses;
  state.sheet.effective_offset_lenses = offset > 0.0 ? offset - 0.5 : offset + 0.5;
}

}  // namespace lenticule::calib
