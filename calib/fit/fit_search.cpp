// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/fit_search.h"

#include <algorithm>

namespace lenticule::calib {
namespace {

constexpr double kMostGeometryPart = 1e-3;  ///< geometry residual, relative to the panel's width
constexpr size_t kMostGaps = 3;  ///< gaps that are fitted if the camera differs from view to view
/// Ratio of costs up to which noise alone explains that cameras differ: simulated noise gives at
/// most 1.009, a shift by 0.1 % of the picture 1.04.
constexpr double kNoise = 1.015;
constexpr int kRoundsForSuspects = 12;  ///< a view that is no suspect converges slowly
constexpr double kAboutAsGood = 1.03;   ///< ratio of costs
constexpr double kAmbiguity = 60.0;     ///< chi-squared by which the best gap must lead
/// Wide patterns are decoded through a smooth map, so their errors are correlated and their many
/// points count as few.
constexpr double kGeometryScatter = 4.0;

/// Searches poses and gaps twice: a wrong gap puts the camera at a slightly wrong distance.
FoundFit attempt(const FitProblem& problem, CameraSameness sameness) {
  const std::vector<View>& views = problem.views;
  const SheetStart& start = problem.start;
  const optics::Panel& panel = problem.panel;
  FoundFit out;
  out.sameness = sameness;
  SheetParameters sheet = start.values;
  out.poses = fit_poses(views, sheet, panel, sameness);
  if (!out.poses) return out;
  JointOptions options = problem.joint_options();
  options.sameness = sameness;
  if (!problem.several()) {
    out.fit = fit_jointly(views, *out.poses, start, std::nullopt, panel, options);
    return out;
  }
  std::vector<GapCandidate> gaps = search_gaps(views, *out.poses, start, panel);
  if (gaps.empty()) return out;
  sheet[kGap] = gaps.front().gap_mm;
  sheet[kShape] = gaps.front().shape;
  if (std::optional<PoseFit> again = fit_poses(views, sheet, panel, sameness)) out.poses = again;
  gaps = search_gaps(views, *out.poses, start, panel);
  if (gaps.empty()) return out;
  out.gap = gaps.front();
  if (gaps.size() > 1 && gaps[1].chi_squared - gaps[0].chi_squared < kAmbiguity)
    out.rival = gaps[1];
  // The search of gaps does not know the shifts of the cameras' axes, which only phases show.
  const size_t tried = sameness == CameraSameness::Same ? 1 : std::min(kMostGaps, gaps.size());
  for (size_t n = 0; n < tried; ++n) {
    std::optional<JointFit> fit = fit_jointly(views, *out.poses, start, gaps[n], panel, options);
    if (!fit || (out.fit && out.fit->cost <= fit->cost)) continue;
    out.fit = std::move(fit);
    out.gap = gaps[n];
  }
  return out;
}

/// Returns true if the cameras differ by an amount that matters, and not because of noise.
bool cameras_differ(const FoundFit& nearly, const FoundFit& same) {
  return nearly.fit && differ_notably(nearly.fit->values.own) &&
         (!same.fit || same.fit->cost > kNoise * nearly.fit->cost);
}

/// Gives each view its own camera. Starts from the fit of one camera, and anew if the cameras
/// differ: then the places and the gap of that fit may be wrong.
FoundFit with_own_cameras(const FitProblem& problem, const FoundFit& same) {
  FoundFit near = same;
  near.sameness = CameraSameness::Nearly;
  if (same.fit) {
    JointOptions options = problem.joint_options();
    options.sameness = CameraSameness::Nearly;
    near.fit =
        fit_jointly(problem.views, *same.poses, problem.start, same.gap, problem.panel, options);
    if (near.fit && !cameras_differ(near, same)) return near;
  }
  FoundFit anew = attempt(problem, CameraSameness::Nearly);
  return !near.fit || (anew.fit && anew.fit->cost < near.fit->cost) ? anew : near;
}

}  // namespace

JointOptions FitProblem::joint_options() const {
  return {.grid = grid,
          .free_gap = several(),
          .free_poses = true,
          .geometry_scatter = kGeometryScatter};
}

FoundFit search_fit(const FitProblem& problem) {
  FoundFit same = attempt(problem, CameraSameness::Same);
  if (!problem.several()) return same;
  FoundFit nearly = with_own_cameras(problem, same);
  if (!cameras_differ(nearly, same)) return same;
  nearly.contradicts = contradict(nearly.fit->values.own);
  return nearly;
}

std::vector<Suspect> find_suspects(const FitProblem& problem, const FoundFit& nearly) {
  const std::vector<View>& views = problem.views;
  std::vector<Suspect> all;
  std::vector<double> costs;
  for (size_t v = 0; v < views.size(); ++v) {
    PoseFit poses{.camera = nearly.fit->values.camera,
                  .own = std::vector<OwnCameraValues>(views.size()),
                  .poses = nearly.fit->values.poses};
    poses.own[v] = nearly.fit->values.own[v];
    JointOptions options = problem.joint_options();
    options.sameness = CameraSameness::Nearly;
    options.only_view = v;
    options.most_rounds = kRoundsForSuspects;
    const auto fit = fit_jointly(views, poses, problem.start, nearly.gap, problem.panel, options);
    if (!fit) continue;
    all.push_back({views[v].name, fit->values.own[v]});
    costs.push_back(fit->cost);
  }
  std::vector<Suspect> likely;
  for (size_t n = 0; n < all.size(); ++n)
    if (costs[n] <= kAboutAsGood * std::ranges::min(costs)) likely.push_back(all[n]);
  return likely;
}

bool is_flat(const JointFit& fit, const optics::Panel& panel) {
  return fit.geometry_rms_px <= kMostGeometryPart * panel.width_px;
}

}  // namespace lenticule::calib
