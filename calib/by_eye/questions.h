// SPDX-License-Identifier: Apache-2.0
// Questions finds a lens sheet from answers to charts. Each chart has 25 bands, columns or rungs,
// and each answer names one of them, or none. Answers may be wrong: Questions asks until the
// answers agree. An answer that contradicts earlier ones makes it ask about both again.
//
// 1. Pitch: Bands with larger, then smaller differences of pitch.
// 2. Slant: SlantBands, the same for the slant.
// 3. Ladders at seven places, which determine pitch, slant and offset together.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "frames/charts/charts.h"
#include "optics/rig.h"

namespace lenticule::calib {

// SheetValues describes a lens sheet as seen by an eye at one distance. The eye sees an effective
// pitch and an effective offset, but cannot separate pitch and gap. Therefore the user edits the
// effective values, and the sheet is computed from them: changing the gap does not change the
// picture for that eye.

/// Formulas: paraxial, see optics/rig.h. All values are for distance D on the rig's
/// viewing height.
struct SheetValues {
  double effective_pitch_subpx = 0.0;    ///< P (1 + g / D)
  double slant = 0.0;                    ///< m; independent of the distance
  double effective_offset_lenses = 0.0;  ///< the phase that the eye sees at the panel's centre
  double gap_mm = 0.0;                   ///< g
  friend bool operator==(const SheetValues&, const SheetValues&) = default;
};

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

// Belief combines answers to "which band is the best?" into the probability of each value, although
// some answers are wrong (a noisy search, see R. Karp and R. Kleinberg, "Noisy binary search and
// its applications", 2007).

/// Returns the rig with its viewing distance replaced by `distance_mm`, which is finite.
[[nodiscard]] inline optics::Rig rig_seen_from(optics::Rig rig, double distance_mm) {
  rig.viewing.distance = Millimetres(distance_mm);
  return rig;
}

[[nodiscard]] inline SheetValues sheet_values(const optics::Rig& rig, double distance_mm) {
  const optics::EffectiveSheet seen = optics::effective_sheet(rig_seen_from(rig, distance_mm));
  return {.effective_pitch_subpx = seen.pitch.value,
          .slant = rig.sheet.slant,
          .effective_offset_lenses = seen.offset.value,
          .gap_mm = rig.sheet.gap.value};
}

/// Returns the rig with the sheet that has these values from `distance_mm`; all else, including the
/// viewing line, stays as in `rig`. The offset is within half a lens of 0.
[[nodiscard]] inline optics::Rig with_sheet_values(optics::Rig rig, const SheetValues& values,
                                                   double distance_mm) {
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

/// Returns D for an eye in the middle, and a longer path for an eye that is `spacing_mm` / 2 to the
/// side.
inline double path_mm(const optics::Rig& rig, double distance_mm, double spacing_mm) {
  const double kappa = 1.0 - rig.sheet.refraction_shape;
  return std::sqrt(distance_mm * distance_mm + 0.25 * kappa * spacing_mm * spacing_mm);
}

inline double effective_lens_mm(const optics::Rig& rig, const SheetValues& values) {
  return values.effective_pitch_subpx * rig.panel.pixel_width.value / 3.0;
}

/// Full cones of commercial lens sheets, with a margin.
inline constexpr double kLeastConeDegrees = 4.0;
inline constexpr double kMostConeDegrees = 75.0;

inline double slant_degrees(const optics::Rig& rig, const SheetValues& values) {
  const optics::Panel& panel = rig.panel;
  return std::atan(values.slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
         std::numbers::pi;
}

/// Returns the angle of the pixels under one lens, seen from its apex.
inline double cone_degrees(const optics::Rig& rig, const SheetValues& values) {
  return 2.0 * std::atan(0.5 * effective_lens_mm(rig, values) / values.gap_mm) * 180.0 /
         std::numbers::pi;
}

/// Returns the reason why these values are implausible for a sheet that started as `start`: a
/// pitch, slant or gap beyond the limits, or a gap whose viewing cone no lens sheet has. The reason
/// is one clause with the value, the start's value and the expected range; empty for plausible
/// values.
[[nodiscard]] inline std::string doubt_of(const optics::Rig& rig, const SheetValues& start,
                                          const SheetValues& values,
                                          const Limits& limits = kImplausible) {
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

/// Returns the gap for which positions of equal picture are `spacing_mm` apart for an eye at
/// `distance_mm`, symmetric to the middle: a lobe is p_h sqrt(D^2 + (1 - nu) (S/2)^2) / g wide.
[[nodiscard]] inline double gap_of_spacing(const optics::Rig& rig, const SheetValues& values,
                                           double distance_mm, double spacing_mm) {
  // g S = p_h path, with p_h = effective lens * D / (D + g): a quadratic equation for g.
  const double c = effective_lens_mm(rig, values) * distance_mm *
                   path_mm(rig, distance_mm, spacing_mm) / spacing_mm;
  return 0.5 * (std::sqrt(distance_mm * distance_mm + 4.0 * c) - distance_mm);
}

/// Returns the spacing for the present gap (the inverse function).
[[nodiscard]] inline double spacing_of_gap(const optics::Rig& rig, const SheetValues& values,
                                           double distance_mm) {
  const double lens_mm =
      effective_lens_mm(rig, values) * distance_mm / (distance_mm + values.gap_mm);
  const double kappa = 1.0 - rig.sheet.refraction_shape;
  // g^2 S^2 = p_h^2 (D^2 + kappa S^2 / 4)
  const double ratio = lens_mm / values.gap_mm;
  const double room = 1.0 - 0.25 * kappa * ratio * ratio;
  return ratio * distance_mm / std::sqrt(std::max(room, 0.05));
}

/// Returns the gap for which an eye at the second distance sees the second effective pitch: P = (D2
/// P2 - D1 P1) / (D2 - D1), g = D1 (P1 - P) / P. The result may be out of range; the rig's
/// validator checks it.
[[nodiscard]] inline double gap_of_two_pitches(double distance_mm, double effective_pitch_subpx,
                                               double second_distance_mm,
                                               double second_pitch_subpx) {
  const double pitch =
      (second_distance_mm * second_pitch_subpx - distance_mm * effective_pitch_subpx) /
      (second_distance_mm - distance_mm);
  return distance_mm * (effective_pitch_subpx - pitch) / pitch;
}

inline constexpr double kStep = 0.05;  ///< distance of two values
/// Share of answers that have nothing to do with the chart. A higher share than the real one costs
/// a few more questions; a lower one costs certainty.
inline constexpr double kWrongShare = 0.15;
inline constexpr double kAnswers = frames::kBands + 1.0;  ///< the bands, and none of them
/// Spread of right answers: in bands, and in lenses where bands are hard to tell apart.
inline constexpr double kSpreadBands = 0.7;
inline constexpr double kSpreadLenses = 0.12;
/// A value this many bands beyond the chart may be taken for its last band.
inline constexpr double kNearBands = 4.0;

inline double bell(double x) { return std::exp(-0.5 * x * x); }

/// Returns the probability of `band` as a right answer if the best band would be `ideal`, which may
/// lie between two bands or beyond the chart.
inline double right_answer(double ideal, double spread, int band) {
  const double beyond = std::abs(ideal - 0.5 * (frames::kBands - 1)) - 0.5 * frames::kBands;
  const bool none = band < 0 || band >= frames::kBands;
  if (beyond > kNearBands) return none ? 1.0 : 0.0;
  if (beyond > 0.0) {
    const int last = ideal < 0.0 ? 0 : frames::kBands - 1;
    return none ? 0.7 : band == last ? 0.3 : 0.0;
  }
  if (none) return beyond > -1.0 ? 0.1 : 0.0;
  double sum = 0.0;
  for (int n = 0; n < frames::kBands; ++n) sum += bell((n - ideal) / spread);
  return bell((band - ideal) / spread) / sum;
}

/// Belief is the probability distribution of one quantity. Its unit is one lens from edge to edge
/// of the panel: the change of pitch or slant that adds one stripe.
class Belief {
 public:
  /// Starts with equal probabilities from -range to +range.
  explicit Belief(double range)
      : range_(range), probability_(static_cast<size_t>(std::ceil(2.0 * range / kStep)) + 1) {
    std::fill(probability_.begin(), probability_.end(),
              1.0 / static_cast<double>(probability_.size()));
  }

  /// Adds the answer to a chart with the values centre - reach ... centre + reach. A `band` that
  /// the chart does not have means that none of its bands is the best.
  void add(double centre, double reach, int band) {
    const double width = 2.0 * reach / (frames::kBands - 1);
    const double spread = std::max(kSpreadBands, kSpreadLenses / width);
    for (size_t n = 0; n < probability_.size(); ++n) {
      const double ideal = (value_of(n) - centre) / width + 0.5 * (frames::kBands - 1);
      probability_[n] *=
          kWrongShare / kAnswers + (1.0 - kWrongShare) * right_answer(ideal, spread, band);
    }
    const double sum = std::accumulate(probability_.begin(), probability_.end(), 0.0);
    for (double& p : probability_) p /= sum;
  }

  /// Returns the most probable value.
  [[nodiscard]] double best() const {
    // Several neighbours can be equally probable: the middle of them.
    const auto first = std::max_element(probability_.begin(), probability_.end());
    const auto last = std::find_if(first, probability_.end(),
                                   [&](double p) { return p < *first * (1.0 - 1e-9); });
    return value_of(static_cast<size_t>(first - probability_.begin())) +
           0.5 * kStep * static_cast<double>(last - first - 1);
  }
  /// Returns the probability of the values within `distance` of `value`.
  [[nodiscard]] double probability_near(double value, double distance) const {
    double sum = 0.0;
    for (size_t n = 0; n < probability_.size(); ++n)
      if (std::abs(value_of(n) - value) <= distance + 0.5 * kStep) sum += probability_[n];
    return sum;
  }

 private:
  [[nodiscard]] double value_of(size_t n) const { return -range_ + static_cast<double>(n) * kStep; }

  double range_;
  std::vector<double> probability_;  ///< sum 1
};

/// Plane is the difference between the true sheet and the chart's, in lenses.
struct Plane {
  double middle = 0.0;  ///< difference at the panel's centre
  double across = 0.0;  ///< change from the left edge to the right one
  double down = 0.0;    ///< change from top to bottom
};

/// LadderQuestion describes one ladder. Rungs are shifted by centre + reach ... centre - reach
/// lenses.
struct LadderQuestion {
  double x = 0.0, y = 0.0;  ///< distance from the panel's centre, panels; x right, y down
  double centre = 0.0;
  double reach = 0.0;
};

struct Position {
  double x, y;
};

/// Positions of the ladders, in panels from the centre. The bend of a sheet whose gap is not known
/// disturbs the edges least if the outer ladders are at 0.43. The two inner ones make sure that a
/// pitch or slant that is wrong by whole lenses from ladder to ladder does not look right.
inline constexpr std::array<Position, 7> kPositions = {
    Position{0.0, 0.0}, {-0.43, -0.36}, {0.43, -0.36}, {0.43, 0.36},
    {-0.43, 0.36},      {0.17, 0.15},   {-0.2, 0.13}};

/// More than half a lens: the colours turn inside the ladder, not at its end.
inline constexpr double kRoughReach = 0.62;
inline constexpr double kFineReach = 0.12;
/// Shift of every second fine ladder, so that equal answers are not equal rungs.
inline constexpr double kFineShift = 0.02;
/// Answers within this range agree.
inline constexpr double kAgreement = 0.03;
/// Distance from the plane above which every place gets another answer.
inline constexpr double kSuspiciousMisfit = 0.01;
/// Distance from the plane that no sheet has.
inline constexpr double kHopelessMisfit = 0.15;
inline constexpr size_t kMostNeeded = 3;
inline constexpr int kLeastForPlane = 3;
inline constexpr int kMostTries = 4;
inline constexpr int kMostBlanks = 3;
inline constexpr int kMostAnswers = 50;

/// Ladders measures how far a chart is from the true sheet, in lenses, at seven places on the
/// panel. A ladder shows the same two colours on every rung, each rung shifted by a little more:
/// the rung on which the colours are equal tells the difference. The differences of a flat sheet
/// lie in a plane.
///
/// A place is known when two answers agree. Places that then lie in no plane get a third answer
/// each, so that a wrong answer or two at one place cannot tilt the plane.
class Ladders {
 public:
  static constexpr int kPlaces = int{kPositions.size()};

  /// Returns the next ladder. Must not be called when is_done().
  [[nodiscard]] LadderQuestion question() const {
    const size_t place = open_place();
    const Position at = kPositions.at(place);
    const std::optional<double> centre = expected(place);
    if (!centre) return {.x = at.x, .y = at.y, .centre = 0.0, .reach = kRoughReach};
    const bool odd = places_.at(place).readings.size() % 2 != 0;
    return {.x = at.x,
            .y = at.y,
            .centre = *centre + (odd ? kFineShift : -kFineShift),
            .reach = kFineReach};
  }
  /// Adds the rung on which red above turns into green below, or a number out of range if no rung
  /// does. Returns false if the answer contradicts another one.
  bool add(int rung) {
    const LadderQuestion asked = question();
    const size_t index = open_place();
    Place& place = places_.at(index);
    ++answers_;
    if (rung < 0 || rung >= frames::kBands) {
      ++place.blanks;
      widen(place);
      return false;
    }
    place.blanks = 0;
    const double lenses =
        asked.centre + frames::band_shift(frames::ChartPattern::Ladder, rung, asked.reach);
    if (asked.reach == kRoughReach) {
      place.rough = lenses;
      return true;
    }
    place.readings.push_back({frames::rung_y(asked.y, rung), lenses});
    const bool fits = agreeing(index).size() == place.readings.size();
    if (++place.tries >= kMostTries && !is_settled(index)) widen(place);
    if (is_done() && needed_ < kMostNeeded && misfit() > kSuspiciousMisfit) ++needed_;
    return fits;
  }

  [[nodiscard]] bool is_done() const {
    for (size_t place = 0; place < kPlaces; ++place)
      if (!is_settled(place)) return false;
    return true;
  }
  /// Returns true if ladder after ladder shows no colours that turn, if the answers do not come to
  /// an end, or if the places are far from every plane: the chart is too far from the true sheet.
  [[nodiscard]] bool is_lost() const {
    if (is_done()) return misfit() > kHopelessMisfit;
    if (answers_ >= kMostAnswers) return true;
    return std::any_of(places_.begin(), places_.end(),
                       [](const Place& place) { return place.blanks >= kMostBlanks; });
  }
  /// Returns the plane through the known places; a flat one if fewer than three are known.
  [[nodiscard]] Plane plane() const;
  /// Returns the largest distance of a known place from the plane, in lenses.
  [[nodiscard]] double misfit() const {
    const Plane flat = plane();
    double largest = 0.0;
    for (size_t place = 0; place < kPlaces; ++place) {
      if (!is_known(place)) continue;
      const std::vector<Reading> group = agreeing(place);
      double mean = 0.0;
      for (const Reading& reading : group) {
        const double there =
            flat.middle + flat.across * kPositions.at(place).x + flat.down * reading.y;
        mean += optics::without_whole_lenses(reading.lenses - there) /
                static_cast<double>(group.size());
      }
      largest = std::max(largest, std::abs(mean));
    }
    return largest;
  }

 private:
  static constexpr size_t kAgreeing = 2;

  struct Reading {
    double y = 0.0;
    double lenses = 0.0;  ///< modulo 1
  };
  struct Place {
    std::optional<double> rough;  ///< the answer to the ladder of all offsets
    bool is_predictable = true;   ///< false if the plane predicted a ladder without an answer
    int tries = 0;                ///< number of fine answers since `rough`
    int blanks = 0;               ///< consecutive ladders without an answer
    std::vector<Reading> readings;
  };

  [[nodiscard]] size_t open_place() const {
    size_t place = 0;
    while (place < kPlaces - 1 && is_settled(place)) ++place;
    return place;
  }
  /// Returns the value to expect at a place: predicted by other places, or known from a ladder of
  /// all offsets.
  [[nodiscard]] std::optional<double> expected(size_t place) const {
    if (places_.at(place).is_predictable && known_places() >= kLeastForPlane) {
      const Plane flat = plane();
      const Position at = kPositions.at(place);
      return flat.middle + flat.across * at.x + flat.down * at.y;
    }
    return places_.at(place).rough;
  }
  /// Returns the largest group of answers at a place that agree.
  [[nodiscard]] std::vector<Reading> agreeing(size_t place) const {
    std::vector<Reading> most;
    for (const Reading& lowest : places_.at(place).readings) {
      std::vector<Reading> group;
      for (const Reading& other : places_.at(place).readings) {
        const double above = optics::without_whole_lenses(other.lenses - lowest.lenses);
        if (above >= 0.0 && above <= kAgreement) group.push_back(other);
      }
      if (group.size() > most.size()) most = std::move(group);
    }
    return most;
  }
  [[nodiscard]] bool is_known(size_t place) const { return agreeing(place).size() >= kAgreeing; }
  [[nodiscard]] bool is_settled(size_t place) const { return agreeing(place).size() >= needed_; }
  [[nodiscard]] int known_places() const {
    int count = 0;
    for (size_t place = 0; place < kPlaces; ++place) count += is_known(place) ? 1 : 0;
    return count;
  }
  /// Makes the next ladder at this place one of all offsets.
  void widen(Place& place) {
    place.rough.reset();
    place.is_predictable = false;
    place.tries = 0;
  }

  std::array<Place, kPlaces> places_;
  int answers_ = 0;
  size_t needed_ = kAgreeing;  ///< number of answers that must agree at every place
};

/// Question is a chart with bands, without the marked band.
struct Question {
  frames::ChartPattern pattern = frames::ChartPattern::Bands;
  SheetValues sheet;  ///< values that the middle band shows
  double reach = 0.0;
  double ladder_x = 0.0;
  double ladder_y = 0.0;
};

inline constexpr double kMostPitchError = 0.12;
inline constexpr double kMostSlantErrorDegrees = 4.5;
/// Differences between the first and the last band: the whole range, a tenth, a hundredth ..., but
/// bands closer together than these look alike.
inline constexpr double kZoom = 10.0;
inline constexpr double kLeastReach = 1.5;
/// A chart of a smaller reach is worth showing if the value is probably on it.
inline constexpr double kInnerPart = 0.8;
inline constexpr double kProbable = 0.6;
/// Ladders can correct pitch and slant by this much, in lenses from edge to edge.
inline constexpr double kLadderRange = 0.45;
inline constexpr double kCertain = 0.99;

/// Returns the reach of the next chart: the smallest one on which the value probably is.
inline double reach_of(const Belief& belief, double range) {
  double reach = range;
  while (reach > kLeastReach) {
    const double smaller = std::max(kLeastReach, reach / kZoom);
    if (belief.probability_near(belief.best(), kInnerPart * smaller) < kProbable) break;
    reach = smaller;
  }
  return reach;
}

inline bool is_certain(const Belief& belief) {
  return belief.probability_near(belief.best(), kLadderRange) >= kCertain;
}

class Questions {
 public:
  /// Starts at the rig's sheet, whose pitch may be off by a tenth and whose slant by four degrees.
  Questions(const optics::Rig& rig, double distance_mm)
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

  /// Returns the chart to answer now. Must not be called when is_done().
  [[nodiscard]] Question question() const {
    Question question{.pattern = frames::ChartPattern::Bands,
                      .sheet = sheet_of(pitch_.best(), slant_.best())};
    switch (stage()) {
      case Stage::Pitch:
        question.reach = reach_of(pitch_, pitch_range_) / (lenses_across_ + pitch_.best());
        break;
      case Stage::Slant:
        question.pattern = frames::ChartPattern::SlantBands;
        question.reach = reach_of(slant_, slant_range_) * slant_per_lens_;
        break;
      case Stage::Ladders: {
        const LadderQuestion ladder = ladders_.question();
        question.pattern = frames::ChartPattern::Ladder;
        question.sheet.effective_offset_lenses += ladder.centre;
        question.reach = ladder.reach;
        question.ladder_x = ladder.x;
        question.ladder_y = ladder.y;
      }
    }
    return question;
  }
  /// Adds an answer; a `band` that the chart does not have means "none". Returns false if the
  /// answer contradicts another one, so that the next charts check both.
  bool answer(int band) {
    answers_.push_back(band);
    return apply(band);
  }
  /// Forgets the last answer; returns false if there is none.
  bool undo() {
    if (answers_.empty()) return false;
    answers_.pop_back();
    start_over();
    contradictions_ = 0;
    for (const int band : answers_) apply(band);
    return true;
  }

  [[nodiscard]] bool is_done() const { return stage() == Stage::Ladders && ladders_.is_done(); }
  /// Returns the best values for the answers so far.
  [[nodiscard]] SheetValues values() const {
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
  [[nodiscard]] int answers() const { return static_cast<int>(answers_.size()); }
  /// Returns the number of answers that contradicted another one.
  [[nodiscard]] int contradictions() const { return contradictions_; }
  /// Returns how far the ladders' places are from one plane, in lenses. A value above 0.03 means a
  /// sheet that is not flat, or wrong answers that agree by chance.
  [[nodiscard]] double misfit() const { return ladders_.misfit(); }

 private:
  enum class Stage { Pitch, Slant, Ladders };

  /// Returns to the first chart, but keeps the answers for undo.
  void start_over() {
    pitch_ = Belief(pitch_range_);
    slant_ = Belief(slant_range_);
    ladders_ = Ladders();
  }
  bool apply(int band) {
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
  [[nodiscard]] Stage stage() const {
    if (!is_certain(pitch_)) return Stage::Pitch;
    return is_certain(slant_) ? Stage::Ladders : Stage::Slant;
  }
  [[nodiscard]] SheetValues sheet_of(double pitch_lenses, double slant_lenses) const {
    SheetValues values = start_;
    values.effective_pitch_subpx *= 1.0 + pitch_lenses / lenses_across_;
    values.slant += slant_lenses * slant_per_lens_;
    return values;
  }
  /// Returns the larger argument, halved until charts around every value in the range show valid
  /// rigs.
  [[nodiscard]] double valid_range(double pitch_lenses, double slant_lenses) const {
    for (double part = 1.0; part > 1e-3; part /= 2.0) {
      const auto is_valid = [&](double times) {
        const SheetValues values =
            sheet_of(times * part * pitch_lenses, times * part * slant_lenses);
        const optics::Rig rig = with_sheet_values(rig_, values, distance_mm_);
        return !optics::find_problem(rig) &&
               !optics::find_problem(rig_seen_from(rig, distance_mm_));
      };
      if (is_valid(-2.0) && is_valid(2.0)) return part * std::max(pitch_lenses, slant_lenses);
    }
    return 0.0;
  }

  optics::Rig rig_;
  double distance_mm_;
  SheetValues start_;
  double lenses_across_;   ///< number of lenses in the panel's width
  double slant_per_lens_;  ///< change of slant that adds one stripe from top to bottom
  double pitch_range_;     ///< largest difference from the start, lenses across the panel
  double slant_range_;     ///< the same for the slant, lenses from top to bottom
  Belief pitch_;
  Belief slant_;
  Ladders ladders_;
  std::vector<int> answers_;
  int contradictions_ = 0;
};

}  // namespace lenticule::calib
