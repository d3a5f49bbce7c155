// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/questions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::calib {
namespace {

using frames::ChartPattern;

constexpr double kMostPitchError = 0.12;
constexpr double kMostSlantErrorDegrees = 4.5;
/// Differences between the first and the last band: the whole range, a tenth, a hundredth ..., but
/// bands closer together than these look alike.
constexpr double kZoom = 10.0;
constexpr double kLeastReach = 1.5;
/// A chart of a smaller reach is worth showing if the value is probably on it.
constexpr double kInnerPart = 0.8;
constexpr double kProbable = 0.6;
/// Ladders can correct pitch and slant by this much, in lenses from edge to edge.
constexpr double kLadderRange = 0.45;
constexpr double kCertain = 0.99;

/// Returns the reach of the next chart: the smallest one on which the value probably is.
double reach_of(const Belief& belief, double range) {
  double reach = range;
  while (reach > kLeastReach) {
    const double smaller = std::max(kLeastReach, reach / kZoom);
    if (belief.probability_near(belief.best(), kInnerPart * smaller) < kProbable) break;
    reach = smaller;
  }
  return reach;
}

bool is_certain(const Belief& belief) {
  return belief.probability_near(belief.best(), kLadderRange) >= kCertain;
}

}  // namespace

Questions::Questions(const optics::Rig& rig, double distance_mm)
    : rig_(rig),
      distance_mm_(distance_mm),
      start_(sheet_values(rig, distance_mm)),
      lenses_across_(3.0 * rig.panel.width_px / start_.effective_pitch_subpx),
      slant_per_lens_(start_.effective_pitch_subpx / (3.0 * rig.panel.height_px)),
      pitch_range_(valid_range(kMostPitchError * lenses_across_, 0.0)),
      slant_range_(valid_range(0.0,
                               [&] {
                                 const double square =
                                     rig.panel.pixel_width.value / rig.panel.pixel_height.value;
                                 const double tangent = rig.sheet.slant * square;
                                 return kMostSlantErrorDegrees * std::numbers::pi / 180.0 *
                                        (1.0 + tangent * tangent) / square / slant_per_lens_;
                               }())),
      pitch_(pitch_range_),
      slant_(slant_range_) {}

/// Returns the larger argument, halved until charts around every value in the range show valid
/// rigs.
double Questions::valid_range(double pitch_lenses, double slant_lenses) const {
  for (double part = 1.0; part > 1e-3; part /= 2.0) {
    const auto is_valid = [&](double times) {
      const SheetValues values = sheet_of(times * part * pitch_lenses, times * part * slant_lenses);
      const optics::Rig rig = with_sheet_values(rig_, values, distance_mm_);
      return !optics::find_problem(rig) && !optics::find_problem(rig_seen_from(rig, distance_mm_));
    };
    if (is_valid(-2.0) && is_valid(2.0)) return part * std::max(pitch_lenses, slant_lenses);
  }
  return 0.0;
}

SheetValues Questions::sheet_of(double pitch_lenses, double slant_lenses) const {
  SheetValues values = start_;
  values.effective_pitch_subpx *= 1.0 + pitch_lenses / lenses_across_;
  values.slant += slant_lenses * slant_per_lens_;
  return values;
}

Questions::Stage Questions::stage() const {
  if (!is_certain(pitch_)) return Stage::Pitch;
  return is_certain(slant_) ? Stage::Ladders : Stage::Slant;
}

Question Questions::question() const {
  Question question{.pattern = ChartPattern::Bands,
                    .sheet = sheet_of(pitch_.best(), slant_.best())};
  switch (stage()) {
    case Stage::Pitch:
      question.reach = reach_of(pitch_, pitch_range_) / (lenses_across_ + pitch_.best());
      break;
    case Stage::Slant:
      question.pattern = ChartPattern::SlantBands;
      question.reach = reach_of(slant_, slant_range_) * slant_per_lens_;
      break;
    case Stage::Ladders: {
      const LadderQuestion ladder = ladders_.question();
      question.pattern = ChartPattern::Ladder;
      question.sheet.effective_offset_lenses += ladder.centre;
      question.reach = ladder.reach;
      question.ladder_x = ladder.x;
      question.ladder_y = ladder.y;
    }
  }
  return question;
}

bool Questions::answer(int band) {
  answers_.push_back(band);
  return apply(band);
}

bool Questions::apply(int band) {
  const Stage asked = stage();
  bool fits = true;
  if (asked == Stage::Ladders) {
    fits = ladders_.add(band);
    if (ladders_.is_lost()) start_over();
  } else {
    Belief& belief = asked == Stage::Pitch ? pitch_ : slant_;
    const double range = asked == Stage::Pitch ? pitch_range_ : slant_range_;
    const double reach = reach_of(belief, range);
    belief.add(belief.best(), reach, band);
    fits = stage() != asked || reach_of(belief, range) <= reach;
  }
  contradictions_ += fits ? 0 : 1;
  return fits;
}

/// Returns to the first chart, but keeps the answers for undo.
void Questions::start_over() {
  pitch_ = Belief(pitch_range_);
  slant_ = Belief(slant_range_);
  ladders_ = Ladders();
}

bool Questions::undo() {
  if (answers_.empty()) return false;
  answers_.pop_back();
  start_over();
  contradictions_ = 0;
  for (const int band : answers_) apply(band);
  return true;
}

SheetValues Questions::values() const {
  SheetValues values = sheet_of(pitch_.best(), slant_.best());
  const Plane off = ladders_.plane();
  // The phase grows by 3 / P lenses per pixel, and by 3 m / P per row.
  const double per_pixel = 3.0 / values.effective_pitch_subpx + off.across / rig_.panel.width_px;
  const double per_row =
      3.0 * values.slant / values.effective_pitch_subpx + off.down / rig_.panel.height_px;
  values.effective_pitch_subpx = 3.0 / per_pixel;
  values.slant = per_row / per_pixel;
  values.effective_offset_lenses += off.middle;
  return values;
}

}  // namespace lenticule::calib
