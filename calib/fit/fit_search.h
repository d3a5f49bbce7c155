// SPDX-License-Identifier: Apache-2.0
// Searches the fit that explains the views best: poses, gap, then all unknowns together. All views
// have one camera, unless they show that the camera differs from view to view.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/fit/gap_search.h"
#include "calib/fit/joint_fit.h"
#include "calib/fit/observations.h"

namespace lenticule::calib {

// Judges how far the camera differs from view to view: a little is normal, because lenses breathe
// when they focus and stabilisers move the lens; more is a zoomed or cropped picture.

/// Returns true if the difference of any view's camera matters for the phases.
[[nodiscard]] bool differ_notably(const std::vector<OwnCameraValues>& own);

/// Returns true if any view's camera differs by more than breathing and stabiliser explain.
[[nodiscard]] bool contradict(const std::vector<OwnCameraValues>& own);

/// Suspect is a view that may be the only one with another camera, and the difference.
struct Suspect {
  std::string name;
  OwnCameraValues own{};
};

/// Returns a sentence that names the suspects.
[[nodiscard]] std::string sentence_about(const std::vector<Suspect>& suspects);

/// Returns a sentence for each view whose camera differs notably.
[[nodiscard]] std::vector<std::string> notes_of(const std::vector<View>& views,
                                                const std::vector<OwnCameraValues>& own);

// Averages a view's phase residuals over cells of the panel, for pictures and for the verdict.

/// CellGrid is a grid of cells over which residuals are averaged.
struct CellGrid {
  int columns, rows;
  double least_blocks;  ///< a cell with fewer blocks has no value
};
inline constexpr CellGrid kPictureCells{48, 27, 1.0};   ///< cells of the report
inline constexpr CellGrid kEvaluatedCells{12, 7, 4.0};  ///< large enough that noise averages out

/// Returns the mean residuals of the cells, NaN for cells with too few blocks. `rests` has one
/// residual for each phase of the view, in lenses; `camera` is the camera of this view.
[[nodiscard]] PanelField mean_over_cells(const View& view, const PoseValues& pose,
                                         const CameraValues& camera,
                                         const std::vector<double>& rests,
                                         const optics::Panel& panel, const CellGrid& grid);

/// FitProblem holds the inputs that all fits of a calibration share.
struct FitProblem {
  std::vector<View> views;
  SheetStart start;
  optics::Panel panel;
  KnotGrid grid;

  [[nodiscard]] bool several() const { return views.size() > 1; }
  [[nodiscard]] JointOptions joint_options() const;
};

/// FoundFit holds the steps of the best fit; the steps after a failed one are empty.
struct FoundFit {
  std::optional<PoseFit> poses;
  std::optional<GapCandidate> gap;    ///< empty with one view
  std::optional<GapCandidate> rival;  ///< gap that agrees with the views about as well
  std::optional<JointFit> fit;
  CameraSameness sameness = CameraSameness::Same;
  bool contradicts = false;  ///< true if a camera differs more than the fit can take into account
};

/// Returns the best fit; each view has its own camera only if the views show that cameras differ.
[[nodiscard]] FoundFit search_fit(const FitProblem& problem);

/// Returns the views whose camera alone, if it differs, explains the views about as well as if it
/// differed at each place. `nearly` has a fit in which each view has its own camera.
[[nodiscard]] std::vector<Suspect> find_suspects(const FitProblem& problem, const FoundFit& nearly);

/// Returns true if the panel points agree with a flat panel.
[[nodiscard]] bool is_flat(const JointFit& fit, const optics::Panel& panel);

// Predicts the phases of a view from the other views, to check the fit where it was not fitted.

/// Smallest number of views for which one of them can be predicted: the others determine the gap.
inline constexpr size_t kLeastForPrediction = 3;

/// Returns the largest error of the phases of view `out`, in lenses, if sheet and map come from the
/// other views and the camera's position from the view's own panel points; the error is a mean over
/// kEvaluatedCells. Empty if the other views do not suffice. Needs kLeastForPrediction views;
/// `found` has a gap and a fit.
[[nodiscard]] std::optional<double> error_from_other_views(const FitProblem& problem,
                                                           const FoundFit& found, size_t out);

}  // namespace lenticule::calib
