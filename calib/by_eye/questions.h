// SPDX-License-Identifier: Apache-2.0
// Questions finds a lens sheet from answers to charts. Each chart has 25 bands, columns or rungs,
// and each answer names one of them, or none. Answers may be wrong: Questions asks until the
// answers agree. An answer that contradicts earlier ones makes it ask about both again.
//
// 1. Pitch: Bands with larger, then smaller differences of pitch.
// 2. Slant: SlantBands, the same for the slant.
// 3. Ladders at seven places, which determine pitch, slant and offset together.
#pragma once

#include <vector>

#include "calib/by_eye/belief.h"
#include "calib/by_eye/ladders.h"
#include "calib/by_eye/sheet_values.h"
#include "frames/charts/chart.h"
#include "optics/rig.h"

namespace lenticule::calib {

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
