// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/cross_validation.h"

#include <algorithm>
#include <cmath>

#include "calib/fit/residual_cells.h"

namespace lenticule::calib {

std::optional<double> error_from_other_views(const FitProblem& problem, const FoundFit& found,
                                             size_t out) {
  const FitValues& all = found.fit->values;
  SheetStart start = problem.start;
  start.values = all.sheet;
  std::vector<View> others = problem.views;
  PoseFit poses{.camera = all.camera, .own = all.own, .poses = all.poses};
  GapCandidate gap = *found.gap;
  const auto at = static_cast<ptrdiff_t>(out);
  others.erase(others.begin() + at);
  poses.own.erase(poses.own.begin() + at);
  poses.poses.erase(poses.poses.begin() + at);
  gap.whole_lenses.erase(gap.whole_lenses.begin() + at);
  for (int& whole : gap.whole_lenses) whole -= out == 0 ? found.gap->whole_lenses[1] : 0;
  gap.gap_mm = all.sheet[kGap];
  gap.shape = all.sheet[kShape];
  JointOptions options = problem.joint_options();
  options.free_poses = false;
  const std::optional<JointFit> part =
      fit_jointly(others, poses, start, gap, problem.panel, options);
  if (!part) return std::nullopt;
  FitValues values = part->values;
  values.camera = all.camera;
  const View& view = problem.views[out];
  const PanelField missed = mean_over_cells(
      view, all.poses[out], camera_of(all.camera, all.own[out], view),
      rests_of(view, all.own[out], all.poses[out], values, problem.grid, problem.panel),
      problem.panel, kEvaluatedCells);
  double worst = 0.0;
  for (const double lenses : missed.values)
    if (std::isfinite(lenses)) worst = std::max(worst, std::abs(lenses));
  return worst;
}

}  // namespace lenticule::calib
