// SPDX-License-Identifier: Apache-2.0
// Simulates a user who answers the questions of calibration by eye. The observer compares the true
// sheet and the chart's by the reference optics (tests/support/oracles/optics_oracle.h), sees no
// difference below a threshold, and gives some answers at random.
#pragma once

#include <random>
#include <vector>

#include "calib/by_eye/procedure.h"

namespace lenticule::calib::test {

struct Eyesight {
  double wrong_share = 0.0;   ///< share of wrong answers
  bool nearly_right = false;  ///< wrong answers are two to four bands off; else any other one
  /// Least difference of (red - green) / (red + green), and of stripes between two bands.
  double threshold = 0.03;
  double stripe_threshold = 0.1;
};

class AnsweringObserver {
 public:
  AnsweringObserver(const optics::Rig& ground_truth, Procedure& procedure, const Eyesight& eyesight,
                    uint64_t seed);

  /// Answers until the procedure stops asking, at most `most` times. Returns the number of answers.
  int answer(int most);
  [[nodiscard]] int presses() const { return presses_; }
  [[nodiscard]] int wrong_answers() const { return wrong_; }

 private:
  [[nodiscard]] int right_answer();
  [[nodiscard]] int wrong_answer(int right);
  [[nodiscard]] int best_band(const Chart& chart);
  [[nodiscard]] int turning_rung(const Chart& chart);
  [[nodiscard]] double stripes(const Chart& chart, int band) const;
  [[nodiscard]] double redness(const Chart& chart, int rung) const;
  void mark_and_enter(int band);
  int draw(int below);

  optics::Rig ground_truth_;
  Procedure& procedure_;
  Eyesight eyesight_;
  std::mt19937_64 random_;
  int presses_ = 0;
  int wrong_ = 0;
};

/// Returns the largest difference of two rigs in the phase that an eye on the viewing line sees,
/// over the panel and the colours, in lenses, without whole lenses.
[[nodiscard]] double worst_error_lenses(const optics::Rig& one, const optics::Rig& other);

}  // namespace lenticule::calib::test
