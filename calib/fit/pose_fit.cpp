// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/pose_fit.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/fit/residuals.h"
#include "calib/measure/panel_map.h"

namespace lenticule::calib {
namespace {

constexpr double kUsualFocal = 0.9;  ///< picture widths
constexpr double kHuberPx = 3.0;     ///< standard errors
constexpr int kRounds = 40;

CameraValues plain_camera(const View& view, double focal_widths) {
  return {focal_widths * view.picture_width, view.picture_width / 2.0, view.picture_height / 2.0,
          0.0, 0.0};
}

/// Returns the pose of a pinhole camera from the homography panel mm -> direction in the camera's
/// frame.
std::optional<PoseValues> pose_of(const Eigen::Matrix3d& direction_from_panel) {
  Eigen::Matrix3d h = direction_from_panel;
  const double scale = 2.0 / (h.col(0).norm() + h.col(1).norm());
  h *= scale;
  if (h(2, 2) < 0.0) h = -h;  // the panel's centre is in front of the camera
  Eigen::Matrix3d rotation;
  rotation.col(0) = h.col(0);
  rotation.col(1) = h.col(1);
  rotation.col(2) = h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  rotation = svd.matrixU() * svd.matrixV().transpose();
  if (!(rotation.determinant() > 0.0)) return std::nullopt;
  const Eigen::Vector3d pupil = -rotation.transpose() * h.col(2);
  const Eigen::AngleAxisd turn(rotation);
  const Eigen::Vector3d axis = turn.angle() * turn.axis();
  PoseValues pose{axis[0], axis[1], axis[2], pupil[0], pupil[1], pupil[2]};
  const bool good =
      std::ranges::all_of(pose, [](double v) { return std::isfinite(v); }) && pupil[2] > 1.0;
  return good ? std::optional(pose) : std::nullopt;
}

std::optional<PoseValues> first_pose(const View& view, const CameraValues& camera,
                                     const optics::Panel& panel) {
  std::vector<Sighting> sightings;
  for (const GeometryPoint& p : view.geometry)
    sightings.push_back({.camera_px = {panel.x_mm(p.panel_px.x), panel.y_mm(p.panel_px.y)},
                         .panel_px = {(p.camera_px.x - camera[kCentreX]) / camera[kFocal],
                                      (p.camera_px.y - camera[kCentreY]) / camera[kFocal]}});
  const std::optional<Homography> h = fit_homography(sightings);
  if (!h) return std::nullopt;
  Eigen::Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = (*h)[static_cast<size_t>(i)];
  return pose_of(m);
}

/// PoseBundle fits all views from a given initial focal length.
class PoseBundle {
 public:
  PoseBundle(const std::vector<View>& views, const SheetParameters& sheet,
             const optics::Panel& panel)
      : views_(views), panel_(panel), sheet_(sheet) {
    fit_.own.assign(views.size(), OwnCameraValues{});
  }

  std::optional<PoseFit> from(double focal_widths, int rounds) {
    fit_.camera = plain_camera(views_.front(), focal_widths);
    fit_.poses.clear();
    for (const View& view : views_) {
      const std::optional<PoseValues> pose = first_pose(view, fit_.camera, panel_);
      if (!pose) return std::nullopt;
      fit_.poses.push_back(*pose);
    }
    return solve(rounds, CameraSameness::Same);
  }

  /// Improves a fit of one camera by giving each view its own.
  std::optional<PoseFit> apart_from(const PoseFit& same, int rounds) {
    fit_ = same;
    return solve(rounds, CameraSameness::Nearly);
  }

 private:
  std::optional<PoseFit> solve(int rounds, CameraSameness sameness) {
    ceres::Problem problem;
    double* const camera = fit_.camera.data();
    size_t residuals = 0;
    for (size_t v = 0; v < views_.size(); ++v) {
      // About 400 blocks per view are enough for so few parameters.
      const size_t stride = std::max<size_t>(1, views_[v].geometry.size() / 400);
      for (size_t n = 0; n < views_[v].geometry.size(); n += stride, residuals += 2)
        problem.AddResidualBlock(geometry_cost(views_[v], views_[v].geometry[n], panel_),
                                 new ceres::HuberLoss(kHuberPx), camera, fit_.own[v].data(),
                                 fit_.poses[v].data(), sheet_.data());
      if (sameness == CameraSameness::Nearly)
        add_own_camera_priors(problem, fit_.own[v].data());
      else
        problem.SetParameterBlockConstant(fit_.own[v].data());
    }
    add_camera_priors(problem, views_.front(), camera);
    problem.SetParameterBlockConstant(sheet_.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = rounds;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return std::nullopt;
    fit_.rms_px = std::sqrt(2.0 * summary.final_cost / static_cast<double>(residuals)) *
                  views_.front().geometry.front().sigma_px;
    for (const PoseValues& pose : fit_.poses)
      if (!(pose[kPupil + 2] > 1.0)) return std::nullopt;
    return fit_;
  }

  const std::vector<View>& views_;
  const optics::Panel& panel_;
  SheetParameters sheet_;
  PoseFit fit_;
};

}  // namespace

std::optional<PoseFit> fit_poses(const std::vector<View>& views, const SheetParameters& sheet,
                                 const optics::Panel& panel, CameraSameness sameness) {
  for (const View& view : views)
    if (view.geometry.size() < 12) return std::nullopt;
  std::optional<PoseFit> best;
  for (const double widths : {0.6, kUsualFocal, 1.4, 2.2}) {
    const std::optional<PoseFit> fit = PoseBundle(views, sheet, panel).from(widths, kRounds);
    if (fit && (!best || fit->rms_px < best->rms_px)) best = fit;
  }
  if (best && sameness == CameraSameness::Nearly)
    return PoseBundle(views, sheet, panel).apart_from(*best, kRounds);
  return best;
}

}  // namespace lenticule::calib
