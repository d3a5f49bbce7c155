// SPDX-License-Identifier: Apache-2.0
// Questions finds a lens sheet from answers to charts. Each chart has 25 bands, columns or rungs,
// and each answer names one of them, or none. Answers may be wrong: Questions asks until the
// answers agree. An answer that contradicts earlier ones makes it ask about both again.
//
// 1. Pitch: Bands with larger, then smaller differences of pitch.
// 2. Slant: SlantBands, the same for the slant.
// 3. Ladders at seven places, which determine pitch, slant and offset together.
#pragma once

#include <array>
#include <cstddef>
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

// Belief combines answers to "which band is the best?" into the probability of each value, although
// some answers are wrong (a noisy search, see R. Karp and R. Kleinberg, "Noisy binary search and
// its applications", 2007).

/// Belief is the probability distribution of one quantity. Its unit is one lens from edge to edge
/// of the panel: the change of pitch or slant that adds one stripe.
class Belief {
 public:
  /// Starts with equal probabilities from -range to +range.
  explicit Belief(double range);

  /// Adds the answer to a chart with the values centre - reach ... centre + reach. A `band` that
  /// the chart does not have means that none of its bands is the best.
  void add(double centre, double reach, int band);

  /// Returns the most probable value.
  [[nodiscard]] double best() const;
  /// Returns the probability of the values within `distance` of `value`.
  [[nodiscard]] double probability_near(double value, double distance) const;

 private:
  [[nodiscard]] double value_of(size_t n) const;

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

/// Ladders measures how far a chart is from the true sheet, in lenses, at seven places on the
/// panel. A ladder shows the same two colours on every rung, each rung shifted by a little more:
/// the rung on which the colours are equal tells the difference. The differences of a flat sheet
/// lie in a plane.
///
/// A place is known when two answers agree. Places that then lie in no plane get a third answer
/// each, so that a wrong answer or two at one place cannot tilt the plane.
class Ladders {
 public:
  static constexpr int kPlaces = 7;

  /// Returns the next ladder. Must not be called when is_done().
  [[nodiscard]] LadderQuestion question() const;
  /// Adds the rung on which red above turns into green below, or a number out of range if no rung
  /// does. Returns false if the answer contradicts another one.
  bool add(int rung);

  [[nodiscard]] bool is_done() const;
  /// Returns true if ladder after ladder shows no colours that turn, if the answers do not come to
  /// an end, or if the places are far from every plane: the chart is too far from the true sheet.
  [[nodiscard]] bool is_lost() const;
  /// Returns the plane through the known places; a flat one if fewer than three are known.
  [[nodiscard]] Plane plane() const;
  /// Returns the largest distance of a known place from the plane, in lenses.
  [[nodiscard]] double misfit() const;

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

  [[nodiscard]] size_t open_place() const;
  [[nodiscard]] std::optional<double> expected(size_t place) const;
  [[nodiscard]] std::vector<Reading> agreeing(size_t place) const;
  [[nodiscard]] bool is_known(size_t place) const;
  [[nodiscard]] bool is_settled(size_t place) const;
  [[nodiscard]] int known_places() const;
  void widen(Place& place);

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

class Questions {
 public:
  /// Starts at the rig's sheet, whose pitch may be off by a tenth and whose slant by four degrees.
  Questions(const optics::Rig& rig, double distance_mm);

  /// Returns the chart to answer now. Must not be called when is_done().
  [[nodiscard]] Question question() const;
  /// Adds an answer; a `band` that the chart does not have means "none". Returns false if the
  /// answer contradicts another one, so that the next charts check both.
  bool answer(int band);
  /// Forgets the last answer; returns false if there is none.
  bool undo();

  [[nodiscard]] bool is_done() const { return stage() == Stage::Ladders && ladders_.is_done(); }
  /// Returns the best values for the answers so far.
  [[nodiscard]] SheetValues values() const;
  [[nodiscard]] int answers() const { return static_cast<int>(answers_.size()); }
  /// Returns the number of answers that contradicted another one.
  [[nodiscard]] int contradictions() const { return contradictions_; }
  /// Returns how far the ladders' places are from one plane, in lenses. A value above 0.03 means a
  /// sheet that is not flat, or wrong answers that agree by chance.
  [[nodiscard]] double misfit() const { return ladders_.misfit(); }

 private:
  enum class Stage { Pitch, Slant, Ladders };

  void start_over();
  bool apply(int band);
  [[nodiscard]] Stage stage() const;
  [[nodiscard]] SheetValues sheet_of(double pitch_lenses, double slant_lenses) const;
  [[nodiscard]] double valid_range(double pitch_lenses, double slant_lenses) const;

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
