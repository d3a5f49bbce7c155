// SPDX-License-Identifier: Apache-2.0
// Prediction computes quantities that a joint fit implies, with standard errors: phases for any
// eye, the line through them, the rig's own parameters.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "calib/calibration.h"
#include "calib/fit/joint_fit.h"
#include "calib/linear_algebra.h"

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
             const LawError& law = {})
      : fit_(fit), grid_(grid), panel_(panel) {
    const Eigen::Index count = kSheetCount + grid.count();
    covariance_ = fit.covariance.topLeftCorner(count, count);
    add(law);
  }

  [[nodiscard]] EffectiveLine effective_line(const Vec3& eye_mm) const {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(3, covariance_.rows());
    over_panel(panel_, kLineColumns, kLineRows, [&](Vec2 p) {
      const Eigen::Vector3d row(1.0, p.x - panel_.width_px / 2.0, p.y - panel_.height_px / 2.0);
      normal += row * row.transpose();
      right += row * phase(fit_.values.sheet, p, eye_mm);
      slopes += row * gradient(p, eye_mm).transpose();
    });
    const Eigen::Matrix3d inverse = inverse_of_symmetric(normal);
    const Eigen::Vector3d line = inverse * right;
    const Eigen::MatrixXd per_parameter = inverse * slopes;
    const Eigen::Matrix3d variance = per_parameter * covariance_ * per_parameter.transpose();
    const double pitch = 3.0 / line[1];
    const double slant = line[2] / line[1];
    const Eigen::RowVector3d d_slant(0.0, -slant / line[1], 1.0 / line[1]);
    return {.pitch_subpx = {pitch, pitch * root(variance(1, 1)) / line[1]},
            .slant = {slant, root(d_slant * variance * d_slant.transpose())},
            .offset_lenses = {line[0], root(variance(0, 0))}};
  }
  [[nodiscard]] SheetReport sheet_report() const {
    const SheetParameters& s = fit_.values.sheet;
    const double pitch = 1.5 * panel_.width_px / s[kAcross];
    const double aspect = static_cast<double>(panel_.width_px) / panel_.height_px;
    const double slant = s[kDown] / s[kAcross] * aspect;
    Eigen::Matrix<double, kSheetCount, kSheetCount> to_rig =
        Eigen::Matrix<double, kSheetCount, kSheetCount>::Identity();
    to_rig(0, kAcross) = -pitch / s[kAcross];
    to_rig(1, kAcross) = -slant / s[kAcross];
    to_rig(1, kDown) = aspect / s[kAcross];
    const Eigen::MatrixXd variance =
        to_rig * covariance_.topLeftCorner(kSheetCount, kSheetCount) * to_rig.transpose();
    const auto sigma = [&](int k) { return root(variance(k, k)); };
    SheetReport report;
    report.parameters = {{"pitch_subpx", "subpixels", {pitch, sigma(0)}},
                         {"slant", "px/px", {slant, sigma(1)}},
                         {"offset_lenses", "lenses", {s[kOffset], sigma(2)}},
                         {"gap_mm", "mm", {s[kGap], sigma(3)}},
                         {"refraction_shape", "", {s[kShape], sigma(4)}},
                         {"fringe_aberration", "gaps", {s[kAberration], sigma(5)}},
                         {"lens_sag", "gaps", {s[kSag], sigma(6)}}};
    report.correlations = correlations_of(variance);
    return report;
  }
  [[nodiscard]] Vec3 eye_sigma(size_t view) const {
    const Eigen::Index at =
        kSheetCount + grid_.count() + kPoseCount * static_cast<Eigen::Index>(view) + kPupil;
    const auto sigma = [&](Eigen::Index k) { return root(fit_.covariance(at + k, at + k)); };
    return {sigma(0), sigma(1), sigma(2)};
  }
  /// Returns two standard errors at the worst panel point for the worst of the eyes.
  [[nodiscard]] DriftPrediction worst_drift(const std::vector<Vec3>& eyes) const {
    DriftPrediction worst;
    for (const Vec3& eye : eyes)
      over_panel(panel_, kDriftColumns, kDriftRows, [&](Vec2 p) {
        const Eigen::VectorXd slopes = gradient(p, eye);
        const double sigma = root(slopes.dot(covariance_ * slopes));
        if (2.0 * sigma > worst.worst_lenses)
          worst = {
              .worst_lenses = 2.0 * sigma, .panel_x_px = p.x, .panel_y_px = p.y, .eye_mm = eye};
      });
    return worst;
  }
  /// Returns the limit within which, with a probability of 97 %, the error stays at all panel
  /// points for all eyes at once; the place is that of worst_drift(). Draws sheets from the
  /// covariance, the same ones in each call.
  [[nodiscard]] DriftPrediction likely_largest_drift(const std::vector<Vec3>& eyes) const {
    constexpr int kDraws = 1000, kWithin = 970;
    DriftPrediction likely = worst_drift(eyes);
    likely.worst_lenses = drawn_drifts(eyes, kDraws)[kWithin];
    return likely;
  }

 private:
  static constexpr int kLineColumns = 33;
  static constexpr int kLineRows = 19;
  static constexpr int kDriftColumns = 9;
  static constexpr int kDriftRows = 5;

  /// Normals returns normally distributed numbers, the same ones with every library (Box and
  /// Muller).
  class Normals {
   public:
    double next() {
      const double radius = std::sqrt(-2.0 * std::log(uniform()));
      return radius * std::cos(2.0 * std::numbers::pi * uniform());
    }

   private:
    double uniform() { return (static_cast<double>(bits_() >> 11) + 0.5) * 0x1p-53; }
    std::mt19937_64 bits_{1};
  };

  /// Calls `point` for every point of a grid over the panel, borders included.
  template <class Point>
  static void over_panel(const optics::Panel& panel, int columns, int rows, const Point& point) {
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x)
        point(Vec2{panel.width_px * x / (columns - 1.0), panel.height_px * y / (rows - 1.0)});
  }

  static double root(double variance) { return std::sqrt(std::max(0.0, variance)); }
  /// Adds the law's errors: a change of pitch changes the phase in proportion to the lenses across
  /// and down.
  void add(const LawError& law) {
    const SheetParameters& s = fit_.values.sheet;
    Eigen::VectorXd pitch = Eigen::VectorXd::Zero(covariance_.rows());
    pitch[kAcross] = law.pitch_lenses;
    pitch[kDown] = law.pitch_lenses * s[kDown] / s[kAcross];
    covariance_ += pitch * pitch.transpose();
    covariance_(kDown, kDown) += law.slant_lenses * law.slant_lenses;
    const double gap = law.gap_part * s[kGap];
    covariance_(kGap, kGap) += gap * gap;
  }
  /// Returns the drawn sheets' largest errors, in increasing order.
  [[nodiscard]] std::vector<double> drawn_drifts(const std::vector<Vec3>& eyes, int draws) const {
    Eigen::MatrixXd slopes(static_cast<Eigen::Index>(eyes.size()) * kDriftColumns * kDriftRows,
                           covariance_.rows());
    Eigen::Index row = 0;
    for (const Vec3& eye : eyes)
      over_panel(panel_, kDriftColumns, kDriftRows,
                 [&](Vec2 p) { slopes.row(row++) = gradient(p, eye).transpose(); });
    const SymmetricAxes axes = axes_of_symmetric(covariance_);
    const Eigen::VectorXd lengths = axes.values.cwiseMax(0.0).cwiseSqrt();
    const Eigen::MatrixXd errors = slopes * axes.vectors * lengths.asDiagonal();
    Normals normals;
    std::vector<double> largest;
    Eigen::VectorXd drawn(covariance_.rows());
    for (int n = 0; n < draws; ++n) {
      for (double& value : drawn) value = normals.next();
      largest.push_back((errors * drawn).cwiseAbs().maxCoeff());
    }
    std::ranges::sort(largest);
    return largest;
  }
  /// Returns d Phi / d (sheet, knots) at a panel point for an eye.
  [[nodiscard]] Eigen::VectorXd gradient(Vec2 panel_px, const Vec3& eye_mm) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(covariance_.rows());
    for (int k = 0; k < kSheetCount; ++k) {
      SheetParameters more = fit_.values.sheet, less = more;
      const double step = 1e-4 * std::max(1e-2, std::abs(more[static_cast<size_t>(k)]));
      more[static_cast<size_t>(k)] += step;
      less[static_cast<size_t>(k)] -= step;
      out[k] = (phase(more, panel_px, eye_mm) - phase(less, panel_px, eye_mm)) / (2.0 * step);
    }
    if (grid_.count() > 0)
      for (const KnotWeight& k : knot_weights(grid_, panel_px, panel_.width_px, panel_.height_px))
        out[kSheetCount + k.knot] += k.weight;
    return out;
  }
  [[nodiscard]] double phase(const SheetParameters& sheet, Vec2 panel_px,
                             const Vec3& eye_mm) const {
    const PoseValues pose{0, 0, 0, eye_mm.x, eye_mm.y, eye_mm.z};
    const PlanePoint<double> wanted{panel_.x_mm(panel_px.x), panel_.y_mm(panel_px.y)};
    PlanePoint<double> lens = wanted;
    for (int step = 0; step < 30; ++step) {
      const auto q = panel_point(pose.data(), sheet.data(), lens);
      lens = {lens.x + wanted.x - q.x, lens.y + wanted.y - q.y};
    }
    return lens_coordinate(sheet.data(), panel_, lens) +
           map_at({panel_.x_px(lens.x), panel_.y_px(lens.y)});
  }
  [[nodiscard]] double map_at(Vec2 panel_px) const {
    double sum = 0.0;
    if (grid_.count() == 0) return sum;
    for (const KnotWeight& k : knot_weights(grid_, panel_px, panel_.width_px, panel_.height_px))
      sum += k.weight * fit_.values.knots[static_cast<size_t>(k.knot)];
    return sum;
  }

  const JointFit& fit_;
  KnotGrid grid_;
  const optics::Panel& panel_;
  Eigen::MatrixXd covariance_;  ///< covariance of sheet and knots
};

}  // namespace lenticule::calib
