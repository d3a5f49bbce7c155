// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/fit_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/fit/projection.h"

namespace lenticule::calib {
namespace {

/// Pulls are differences in standard deviations of the priors. Below this pull the phases change by
/// less than 0.004 lens.
constexpr double kNotablePull = 0.5;
constexpr double kMostFocalPull = 3.0;
/// A shift of the axis along the line of the places may have happened at any of them; above this
/// pull the phases could be off by more than 0.02 lens.
constexpr double kMostCentrePull = 1.6;

double focal_pull(const OwnCameraValues& own) {
  return std::abs(own[kOwnFocal]) / kOwnFocalSigma;
}
double centre_pull(const OwnCameraValues& own) {
  return std::hypot(own[kOwnCentreX], own[kOwnCentreY]) / kOwnCentreSigma;
}
double pull(const OwnCameraValues& own) {
  return std::max(focal_pull(own), centre_pull(own));
}
bool zoomed(const OwnCameraValues& own) {
  return focal_pull(own) >= centre_pull(own);
}

/// Returns the difference between a view's camera and the mean of the others.
OwnCameraValues apart_from_others(const std::vector<OwnCameraValues>& own, size_t view) {
  OwnCameraValues apart = own[view];
  const double others = static_cast<double>(own.size() - 1);
  for (size_t v = 0; v < own.size(); ++v)
    for (size_t k = 0; v != view && k < apart.size(); ++k) apart[k] -= own[v][k] / others;
  return apart;
}

/// Returns a difference in words, without the name of the view.
std::string words_for(const OwnCameraValues& apart) {
  if (zoomed(apart))
    return fmt::format("the focal length is {:.1f} % {} than at the other places",
                       100.0 * std::abs(apart[kOwnFocal]),
                       apart[kOwnFocal] > 0.0 ? "longer" : "shorter");
  return fmt::format(
      "the axis of the camera is {:.2f} % of the picture's longer side from where it is at the "
      "other places",
      100.0 * std::hypot(apart[kOwnCentreX], apart[kOwnCentreY]));
}

}  // namespace

bool differ_notably(const std::vector<OwnCameraValues>& own) {
  return std::ranges::any_of(own, [](const auto& one) { return pull(one) > kNotablePull; });
}

bool contradict(const std::vector<OwnCameraValues>& own) {
  return std::ranges::any_of(own, [](const auto& one) {
    return focal_pull(one) > kMostFocalPull || centre_pull(one) > kMostCentrePull;
  });
}

std::string sentence_about(const std::vector<Suspect>& suspects) {
  if (suspects.empty())
    return "the camera differs from place to place: photograph all places again, with the same "
           "zoom, focus and size of the pictures";
  std::string all;
  for (const Suspect& suspect : suspects)
    all +=
        fmt::format("{}{}: {}", all.empty() ? "" : ", or ", suspect.name, words_for(suspect.own));
  const bool zoom = zoomed(suspects.front().own);
  return fmt::format("{}: {}; photograph {} again", all,
                     zoom ? "the camera zoomed, focused anew, or uses another lens"
                          : "the pictures are cropped, or the stabiliser moved the lens",
                     suspects.size() == 1 ? "this place" : "these places");
}

std::vector<std::string> notes_of(const std::vector<View>& views,
                                  const std::vector<OwnCameraValues>& own) {
  // If one of three views differs, the common camera is in between, and the others are off by half.
  constexpr double kOutstanding = 0.6;
  const double most = pull(*std::ranges::max_element(own, {}, pull));
  std::vector<std::string> notes;
  for (size_t v = 0; v < own.size(); ++v)
    if (pull(own[v]) > std::max(kNotablePull, kOutstanding * most))
      notes.push_back(fmt::format("{}: {}; the fit takes this into account", views[v].name,
                                  words_for(apart_from_others(own, v))));
  return notes;
}

PanelField mean_over_cells(const View& view, const PoseValues& pose, const CameraValues& camera,
                           const std::vector<double>& rests, const optics::Panel& panel,
                           const CellGrid& grid) {
  PanelField field{.columns = grid.columns, .rows = grid.rows, .values = {}};
  const auto cells = static_cast<size_t>(field.columns * field.rows);
  std::vector<double> sums(cells, 0.0), counts(cells, 0.0);
  for (size_t n = 0; n < rests.size(); ++n) {
    const Vec2 pixel = view.phases[n].camera_px;
    const auto lens = lens_plane_point(camera.data(), pose.data(), pixel.x, pixel.y);
    const int column = static_cast<int>(panel.x_px(lens.x) / panel.width_px * field.columns);
    const int row = static_cast<int>(panel.y_px(lens.y) / panel.height_px * field.rows);
    if (column < 0 || row < 0 || column >= field.columns || row >= field.rows) continue;
    const auto cell = static_cast<size_t>(row * field.columns + column);
    sums[cell] += rests[n];
    counts[cell] += 1.0;
  }
  for (size_t cell = 0; cell < cells; ++cell)
    field.values.push_back(counts[cell] >= grid.least_blocks
                               ? sums[cell] / counts[cell]
                               : std::numeric_limits<double>::quiet_NaN());
  return field;
}

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
