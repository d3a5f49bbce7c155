// SPDX-License-Identifier: Apache-2.0
// Fits the camera's poses to the panel points that it saw, then all views together: lens sheet,
// residual map, camera and poses in one robust least-squares fit.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibration.h"
#include "calib/fit/observations.h"

namespace lenticule::calib {

/// Fits the camera's positions and optics to the panel points that all views saw; the sheet is
/// held. Starts from the homographies of the views, with
/// several focal lengths. Returns nothing if no camera fits. If all views face the panel squarely,
/// a weak prior of 0.9 picture widths determines the focal length.
[[nodiscard]] std::optional<PoseFit> fit_poses(const std::vector<View>& views,
                                               const SheetParameters& sheet,
                                               const optics::Panel& panel,
                                               CameraSameness sameness = CameraSameness::Same);

// Searches the gap. Views from different sides see phases that differ by the gap times their
// distance, but each phase is known only up to whole lenses, so several gaps fit about equally
// well. The search tries all combinations of whole numbers: for a given combination the remaining
// problem is linear.

struct GapCandidate {
  std::vector<int> whole_lenses;  ///< added to the phase of each view; 0 for the first
  double gap_mm = 0.0;
  double shape = 0.0;
  double rms_lenses = 0.0;
  /// Sum of squares divided by the variance of the best candidate's residuals, priors included.
  double chi_squared = 0.0;
};

/// Returns the candidates, best first, one for each plausible combination. Needs at least two
/// views.
[[nodiscard]] std::vector<GapCandidate> search_gaps(const std::vector<View>& views,
                                                    const PoseFit& poses, const SheetStart& start,
                                                    const optics::Panel& panel);

struct JointOptions {
  KnotGrid grid{.columns = 24, .rows = 14};
  bool free_gap = true;    ///< else the starting gap and shape are held
  bool free_poses = true;  ///< else the starting poses and cameras are held
  CameraSameness sameness = CameraSameness::Same;
  /// With CameraSameness::Nearly: the only view whose camera may differ, by any amount.
  std::optional<size_t> only_view{};
  /// Measured distances of the first views from the panel; a value of 0 is unknown.
  std::vector<Estimate> distances_mm{};
  /// Prior standard deviation of the map's second differences, lenses.
  double bend_sigma = 0.04;
  /// Factor on the standard errors of geometry points relative to their scatter: above 1 if errors
  /// of neighbouring points are correlated.
  double geometry_scatter = 1.0;
  int most_rounds = 40;
};

struct JointFit {
  FitValues values;
  /// Cost with the standard errors that the observations state, for comparing fits.
  double cost = 0.0;
  double phase_rms = 0.0;        ///< lenses
  double geometry_rms_px = 0.0;  ///< panel pixels
  /// Ratio of the phases' scatter to the scatter inside the blocks.
  double phase_scale = 1.0;
  /// Covariance of sheet, knots and poses in this order (kSheetCount + knots + 6 per view); rows of
  /// gap and shape are zero if they were held. Empty if the poses were held.
  Eigen::MatrixXd covariance;
  /// Phase residual at each phase observation of each view, lenses.
  std::vector<std::vector<double>> rests;
};

/// Returns the fit; empty if it does not converge.
///
/// Lifetime: `views` must outlive the call.
[[nodiscard]] std::optional<JointFit> fit_jointly(const std::vector<View>& views,
                                                  const PoseFit& poses, const SheetStart& start,
                                                  const std::optional<GapCandidate>& gap,
                                                  const optics::Panel& panel,
                                                  const JointOptions& options);

/// Returns the phase residuals of a view that the fit did not use, without whole lenses.
[[nodiscard]] std::vector<double> rests_of(const View& view, const OwnCameraValues& own,
                                           const PoseValues& pose, const FitValues& values,
                                           const KnotGrid& grid, const optics::Panel& panel);

// Searches the fit that explains the views best: poses, gap, then all unknowns together. All views
// have one camera, unless they show that the camera differs from view to view.

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
