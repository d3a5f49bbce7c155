// SPDX-License-Identifier: Apache-2.0
// Prediction computes quantities that a joint fit implies, with standard errors: phases for any
// eye, the line through them, the rig's own parameters.
#pragma once

#include <vector>

#include "calib/calibration.h"
#include "calib/fit/joint_fit.h"

namespace lenticule::calib {

/// EffectiveLine is the least-squares line through the phase that an eye sees over the whole panel.
struct EffectiveLine {
  Estimate pitch_subpx;
  Estimate slant;
  Estimate offset_lenses;
};

struct SheetReport {
  std::vector<Parameter> parameters;  ///< same order as SheetParameters
  std::vector<std::vector<double>> correlations;
};

/// LawError is the deviation of real lenses from the fitted law, as standard deviations: an error
/// that noise does not explain and that more blocks do not reduce.
struct LawError {
  double pitch_lenses = 0.0;  ///< error at the left and right edges of the panel
  double slant_lenses = 0.0;  ///< error at the panel's upper and lower edges
  double gap_part = 0.0;      ///< fraction of the gap
};

/// Prediction evaluates a fit.
///
/// Lifetime: the fit and the panel must outlive the prediction.
class Prediction {
 public:
  Prediction(const JointFit& fit, const KnotGrid& grid, const optics::Panel& panel,
             const LawError& law = {});

  [[nodiscard]] EffectiveLine effective_line(const Vec3& eye_mm) const;
  [[nodiscard]] SheetReport sheet_report() const;
  [[nodiscard]] Vec3 eye_sigma(size_t view) const;
  /// Returns two standard errors at the worst panel point for the worst of the eyes.
  [[nodiscard]] DriftPrediction worst_drift(const std::vector<Vec3>& eyes) const;
  /// Returns the limit within which, with a probability of 95 %, the error stays at all panel
  /// points for all eyes at once; the place is that of worst_drift(). Draws sheets from the
  /// covariance, the same ones in each call.
  [[nodiscard]] DriftPrediction likely_largest_drift(const std::vector<Vec3>& eyes) const;

 private:
  void add(const LawError& law);
  /// Returns the drawn sheets' largest errors, in increasing order.
  [[nodiscard]] std::vector<double> drawn_drifts(const std::vector<Vec3>& eyes, int draws) const;
  /// Returns d Phi / d (sheet, knots) at a panel point for an eye.
  [[nodiscard]] Eigen::VectorXd gradient(Vec2 panel_px, const Vec3& eye_mm) const;
  [[nodiscard]] double phase(const SheetParameters& sheet, Vec2 panel_px, const Vec3& eye_mm) const;
  [[nodiscard]] double map_at(Vec2 panel_px) const;

  const JointFit& fit_;
  KnotGrid grid_;
  const optics::Panel& panel_;
  Eigen::MatrixXd covariance_;  ///< covariance of sheet and knots
};

}  // namespace lenticule::calib
