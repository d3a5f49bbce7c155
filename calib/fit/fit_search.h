// SPDX-License-Identifier: Apache-2.0
// Searches the fit that explains the views best: poses, gap, then all unknowns together. All views
// have one camera, unless they show that the camera differs from view to view.
#pragma once

#include <optional>
#include <vector>

#include "calib/fit/gap_search.h"
#include "calib/fit/joint_fit.h"
#include "calib/fit/own_cameras.h"
#include "calib/fit/pose_fit.h"

namespace lenticule::calib {

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

}  // namespace lenticule::calib
