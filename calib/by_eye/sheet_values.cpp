// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/sheet_values.h"

#include <algorithm>
#include <cmath>

#include "optics/effective_sheet.h"

namespace lenticule::calib {

optics::Rig rig_seen_from(optics::Rig rig, double distance_mm) {
  rig.viewing.distance = Millimetres(distance_mm);
  return rig;
}

SheetValues sheet_values(const optics::Rig& rig, double distance_mm) {
  const optics::EffectiveSheet seen = optics::effective_sheet(rig_seen_from(rig, distance_mm));
  return {.effective_pitch_subpx = seen.pitch.value,
          .slant = rig.sheet.slant,
          .effective_offset_lenses = seen.offset.value,
          .gap_mm = rig.sheet.gap.value};
}

optics::Rig with_sheet_values(optics::Rig rig, const SheetValues& values, double distance_mm) {
  optics::LensSheet& sheet = rig.sheet;
  sheet.pitch = Subpixels(values.effective_pitch_subpx / (1.0 + values.gap_mm / distance_mm));
  sheet.slant = values.slant;
  sheet.gap = Millimetres(values.gap_mm);
  // With offset 0, what the eye sees at the centre is what height and slant add.
  sheet.offset = Lenses(0.0);
  const double added = optics::effective_sheet(rig_seen_from(rig, distance_mm)).offset.value;
  sheet.offset = Lenses(optics::without_whole_lenses(values.effective_offset_lenses - added));
  return rig;
}

namespace {

/// D for an eye in the middle, longer for one that sits `spacing_mm` / 2 aside.
double path_mm(const optics::Rig& rig, double distance_mm, double spacing_mm) {
  const double kappa = 1.0 - rig.sheet.refraction_shape;
  return std::sqrt(distance_mm * distance_mm + 0.25 * kappa * spacing_mm * spacing_mm);
}

double effective_lens_mm(const optics::Rig& rig, const SheetValues& values) {
  return values.effective_pitch_subpx * rig.panel.pixel_width.value / 3.0;
}

}  // namespace

double gap_of_spacing(const optics::Rig& rig, const SheetValues& values, double distance_mm,
                      double spacing_mm) {
  // g S = p_h path, with p_h = effective lens * D / (D + g): a quadratic equation for g.
  const double c = effective_lens_mm(rig, values) * distance_mm *
                   path_mm(rig, distance_mm, spacing_mm) / spacing_mm;
  return 0.5 * (std::sqrt(distance_mm * distance_mm + 4.0 * c) - distance_mm);
}

double spacing_of_gap(const optics::Rig& rig, const SheetValues& values, double distance_mm) {
  const double lens_mm =
      effective_lens_mm(rig, values) * distance_mm / (distance_mm + values.gap_mm);
  const double kappa = 1.0 - rig.sheet.refraction_shape;
  // g^2 S^2 = p_h^2 (D^2 + kappa S^2 / 4)
  const double ratio = lens_mm / values.gap_mm;
  const double room = 1.0 - 0.25 * kappa * ratio * ratio;
  return ratio * distance_mm / std::sqrt(std::max(room, 0.05));
}

double gap_of_two_pitches(double distance_mm, double effective_pitch_subpx,
                          double second_distance_mm, double second_pitch_subpx) {
  const double pitch =
      (second_distance_mm * second_pitch_subpx - distance_mm * effective_pitch_subpx) /
      (second_distance_mm - distance_mm);
  return distance_mm * (effective_pitch_subpx - pitch) / pitch;
}

}  // namespace lenticule::calib
