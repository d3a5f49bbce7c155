// SPDX-License-Identifier: Apache-2.0
// Somebody who calibrates by eye: looks at what the lens sheet as it truly is shows of the charts,
// and presses keys by what a person could see as well: how many stripes there are and how they run,
// which side is brighter or greener. Never reads a rig.
#pragma once

#include <functional>
#include <vector>

#include "calib/by_eye/procedure.h"
#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::calib::test {

/// What an eye sees, coarsely: linear light, rows from the top.
struct Glimpse {
  int columns = 0;
  int rows = 0;
  std::vector<double> red, green, blue;

  [[nodiscard]] double light(int column, int row) const;
  /// (red - green) / (red + green) over the part [x0, x1) x [y0, y1) of the picture, 0 ... 1 each.
  [[nodiscard]] double redness(double x0, double x1, double y0, double y1) const;
};

/// Stripes as cycles over the whole width and height; which way they move nobody can see, so the
/// sign of the pair means nothing.
struct Stripes {
  double across = 0.0;
  double down = 0.0;
  bool seen = false;  ///< else the picture is even
};

class ScriptedObserver {
 public:
  ScriptedObserver(const optics::Rig& truth, Procedure& procedure);

  /// From Prepare to the end of Check.
  void find_sheet();
  void find_gap_by_flips();
  void find_gap_by_distance();
  void press(Key key, Stride stride = Stride::Normal) { procedure_.press({key, stride}); }
  [[nodiscard]] int glimpses() const { return glimpses_; }

  /// The chart of the procedure, from (x, 0) at the distance that it asks for.
  [[nodiscard]] Glimpse look(double x_mm, int columns, int rows);

 private:
  void choose_band();
  void straighten_stripes();
  void spread_stripes();
  void balance_colours();
  void even_out(int rounds);
  [[nodiscard]] Stripes stripes();
  [[nodiscard]] double crossing(double from_mm, double to_mm);

  /// Presses `more` or `less` until the measure is nearly 0; which of both helps is found out by
  /// trying. `presses_per_unit`: of the normal stride, for a measure of 1.
  void null(const std::function<double()>& measure, double presses_per_unit, Key more, Key less,
            int rounds = 5);
  /// As many presses as `presses` of the normal stride, in tenths.
  void press_often(double presses, Key more, Key less);

  optics::OpticalModel truth_;
  Procedure& procedure_;
  frames::WovenFrame frame_;
  int glimpses_ = 0;
};

}  // namespace lenticule::calib::test
