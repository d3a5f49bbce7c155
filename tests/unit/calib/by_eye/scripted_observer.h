// SPDX-License-Identifier: Apache-2.0
// Simulates a user who looks for the gap by eye: the observer sees the charts through the true lens
// sheet, and presses keys by what a person sees as well: which side is redder or greener.
#pragma once

#include <functional>
#include <vector>

#include "calib/by_eye/procedure.h"
#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::calib::test {

/// A coarse picture as an eye sees it: linear light, rows from the top.
struct Glimpse {
  int columns = 0;
  int rows = 0;
  std::vector<double> red, green, blue;

  /// Returns (red - green) / (red + green) over the part [x0, x1) x [y0, y1) of the picture, 0 ...
  /// 1 each.
  [[nodiscard]] double redness(double x0, double x1, double y0, double y1) const;
};

class ScriptedObserver {
 public:
  ScriptedObserver(const optics::Rig& ground_truth, Procedure& procedure);

  void find_gap_by_flips();
  void find_gap_by_distance();
  void press(Key key, Stride stride = Stride::Normal) { procedure_.press({key, stride}); }

  /// Returns the procedure's chart as seen from (x, 0) at the distance that the procedure requests.
  [[nodiscard]] Glimpse look(double x_mm, int columns, int rows);

 private:
  [[nodiscard]] double crossing(double from_mm, double to_mm);

  /// Presses `more` or `less` until the measure is nearly 0, and finds out by trying which of both
  /// helps. `presses_per_unit`: presses of the normal stride for a measure of 1.
  void null(const std::function<double()>& measure, double presses_per_unit, Key more, Key less,
            int rounds);
  /// Presses keys for `presses` strides, in tenths of the normal stride.
  void press_often(double presses, Key more, Key less);

  optics::OpticalModel ground_truth_;
  Procedure& procedure_;
  frames::WovenFrame frame_;
};

}  // namespace lenticule::calib::test
