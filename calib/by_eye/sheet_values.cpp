// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/sheet_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

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
  // The eye sees at the centre, with offset 0, only the contribution of height and slant.
  sheet.offset = Lenses(0.0);
  const double added = optics::effective_sheet(rig_seen_from(rig, distance_mm)).offset.value;
  sheet.offset = Lenses(optics::without_whole_lenses(values.effective_offset_lenses - added));
  return rig;
}

namespace {

/// Returns D for an eye in the middle, and a longer path for an eye that is `spacing_mm` / 2 to the
/// side.
double path_mm(const optics::Rig& rig, double distance_mm, double spacing_mm) {
  const double kappa = 1.0 - rig.sheet.refraction_shape;
  return std::sqrt(distance_mm * distance_mm + 0.25 * kappa * spacing_mm * spacing_mm);
}

double effective_lens_mm(const optics::Rig& rig, const SheetValues& values) {
  return values.effective_pitch_subpx * rig.panel.pixel_width.value / 3.0;
}

/// Full cones of commercial lens sheets, with a margin.
constexpr double kLeastConeDegrees = 4.0;
constexpr double kMostConeDegrees = 75.0;

double slant_degrees(const optics::Rig& rig, const SheetValues& values) {
  const optics::Panel& panel = rig.panel;
  return std::atan(values.slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
         std::numbers::pi;
}

/// Returns the angle of the pixels under one lens, seen from its apex.
double cone_degrees(const optics::Rig& rig, const SheetValues& values) {
  return 2.0 * std::atan(0.5 * effective_lens_mm(rig, values) / values.gap_mm) * 180.0 /
         std::numbers::pi;
}

}  // namespace

std::string doubt_of(const optics::Rig& rig, const SheetValues& start, const SheetValues& values,
                     const Limits& limits) {
  const double pitch = values.effective_pitch_subpx / start.effective_pitch_subpx;
  if (pitch > limits.pitch_ratio || pitch < 1.0 / limits.pitch_ratio)
    return fmt::format(
        "a pitch of {:.3f} subpixels differs by {:.0f} % from the {:.3f} of the start",
        values.effective_pitch_subpx, 100.0 * std::abs(pitch - 1.0), start.effective_pitch_subpx);
  const double turned = slant_degrees(rig, values) - slant_degrees(rig, start);
  if (std::abs(turned) > limits.turn_degrees)
    return fmt::format("a slant of {:.1f} degrees differs by {:.1f} from the {:.1f} of the start",
                       slant_degrees(rig, values), std::abs(turned), slant_degrees(rig, start));
  const double gap = values.gap_mm / start.gap_mm;
  if (gap > limits.gap_ratio || gap < 1.0 / limits.gap_ratio)
    return fmt::format("a gap of {:.2f} mm is {} {:.1f} times the {:.2f} mm of the start",
                       values.gap_mm, gap > 1.0 ? "more than" : "less than",
                       gap > 1.0 ? std::floor(10.0 * gap) / 10.0 : std::ceil(10.0 * gap) / 10.0,
                       start.gap_mm);
  const double cone = cone_degrees(rig, values), before = cone_degrees(rig, start);
  const bool worse = std::abs(values.gap_mm - start.gap_mm) > 0.01 * start.gap_mm;
  if (worse &&
      ((cone < kLeastConeDegrees && cone < before) || (cone > kMostConeDegrees && cone > before)))
    return fmt::format(
        "a gap of {:.2f} mm makes a viewing cone of {:.1f} degrees; lens sheets have {:.0f} to "
        "{:.0f}",
        values.gap_mm, cone, kLeastConeDegrees, kMostConeDegrees);
  return "";
}

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
