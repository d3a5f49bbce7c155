// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/residuals.h"

#include <ceres/normal_prior.h>

#include <array>
#include <cmath>

namespace lenticule::calib {
namespace {

constexpr int kModelCount = kCameraCount + kOwnCount + kPoseCount + kSheetCount;
constexpr std::array<int, 4> kModelCounts = {kCameraCount, kOwnCount, kPoseCount, kSheetCount};
constexpr size_t kModelBlocks = kModelCounts.size();

class GeometryResidual {
 public:
  GeometryResidual(const View& view, const GeometryPoint& point, const optics::Panel& panel)
      : longer_px_(view.longer_px()), point_(point), panel_(&panel) {}

  template <class T>
  bool operator()(const T* common, const T* own, const T* pose, const T* sheet, T* out) const {
    T camera[kCameraCount];
    camera_of_view(common, own, longer_px_, camera);
    const PlanePoint<T> lens =
        lens_plane_point(camera, pose, point_.camera_px.x, point_.camera_px.y);
    const PlanePoint<T> seen = wide_pattern_point(pose, sheet, *panel_, lens);
    out[0] = (seen.x / panel_->pixel_width.value + panel_->width_px / 2.0 - point_.panel_px.x) /
             point_.sigma_px;
    out[1] = (panel_->height_px / 2.0 - seen.y / panel_->pixel_height.value - point_.panel_px.y) /
             point_.sigma_px;
    return true;
  }

 private:
  double longer_px_;
  GeometryPoint point_;
  const optics::Panel* panel_;
};

/// PhaseCost is the phase term: derivatives of the model parameters by dual numbers, of the
/// knots analytically.
class PhaseCost final : public ceres::CostFunction {
 public:
  PhaseCost(const View& view, const PhaseObservation& seen, const optics::Panel& panel,
            const std::vector<KnotWeight>& knots)
      : longer_px_(view.longer_px()), seen_(seen), fringe_(view.fringe), panel_(panel) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->assign(kModelCounts.begin(), kModelCounts.end());
    for (const KnotWeight& knot : knots) {
      weights_.push_back(knot.weight);
      mutable_parameter_block_sizes()->push_back(1);
    }
  }

  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override {
    double map = 0.0;
    for (size_t k = 0; k < weights_.size(); ++k)
      map += weights_[k] * parameters[kModelBlocks + k][0];
    if (jacobians == nullptr) {
      const double turns = model_turns(parameters[0], parameters[1], parameters[2], parameters[3]);
      residual[0] = rest(turns - map) / seen_.sigma;
      return std::isfinite(residual[0]);
    }
    using Jet = ceres::Jet<double, kModelCount>;
    std::array<Jet, kModelCount> values;
    int first = 0;
    std::array<const Jet*, kModelBlocks> blocks{};
    for (size_t block = 0; block < kModelBlocks; ++block) {
      blocks[block] = values.data() + first;
      for (int k = 0; k < kModelCounts[block]; ++k)
        values[static_cast<size_t>(first + k)] = Jet(parameters[block][k], first + k);
      first += kModelCounts[block];
    }
    const Jet turns = model_turns(blocks[0], blocks[1], blocks[2], blocks[3]);
    residual[0] = rest(turns.a - map) / seen_.sigma;
    first = 0;
    for (size_t block = 0; block < kModelBlocks; ++block) {
      for (int k = 0; k < kModelCounts[block] && jacobians[block] != nullptr; ++k)
        jacobians[block][k] = -turns.v[first + k] / seen_.sigma;
      first += kModelCounts[block];
    }
    for (size_t k = 0; k < weights_.size(); ++k)
      if (jacobians[kModelBlocks + k] != nullptr)
        jacobians[kModelBlocks + k][0] = weights_[k] / seen_.sigma;
    return std::isfinite(residual[0]);
  }

 private:
  template <class T>
  T model_turns(const T* common, const T* own, const T* pose, const T* sheet) const {
    T camera[kCameraCount];
    camera_of_view(common, own, longer_px_, camera);
    const PlanePoint<T> lens = lens_plane_point(camera, pose, seen_.camera_px.x, seen_.camera_px.y);
    const PlanePoint<T> q = fringe_point(pose, sheet, panel_, lens);
    return fringe_turns(fringe_, panel_, q) - lens_coordinate(sheet, panel_, lens);
  }
  [[nodiscard]] double rest(double model) const {
    const double difference = seen_.turns - model;
    return difference - std::round(difference);
  }

  double longer_px_;
  PhaseObservation seen_;
  Fringe fringe_;
  const optics::Panel& panel_;
  std::vector<double> weights_;
};

class LinearCost final : public ceres::CostFunction {
 public:
  LinearCost(const std::vector<double>& weights, double sigma) : weights_(weights) {
    for (double& weight : weights_) {
      weight /= sigma;
      mutable_parameter_block_sizes()->push_back(1);
    }
    set_num_residuals(1);
  }
  bool Evaluate(const double* const* parameters, double* residual,
                double** jacobians) const override {
    residual[0] = 0.0;
    for (size_t k = 0; k < weights_.size(); ++k) {
      residual[0] += weights_[k] * parameters[k][0];
      if (jacobians != nullptr && jacobians[k] != nullptr) jacobians[k][0] = weights_[k];
    }
    return true;
  }

 private:
  std::vector<double> weights_;
};

/// CameraPrior is (value - expected) / sigma for each camera parameter.
class CameraPrior {
 public:
  CameraPrior(const CameraValues& prior, const CameraValues& sigma)
      : prior_(prior), sigma_(sigma) {}
  template <class T>
  bool operator()(const T* camera, T* out) const {
    for (int k = 0; k < kCameraCount; ++k)
      out[k] = (camera[k] - prior_[static_cast<size_t>(k)]) / sigma_[static_cast<size_t>(k)];
    return true;
  }

 private:
  CameraValues prior_;
  CameraValues sigma_;
};

}  // namespace

ceres::CostFunction* geometry_cost(const View& view, const GeometryPoint& point,
                                   const optics::Panel& panel) {
  return new ceres::AutoDiffCostFunction<GeometryResidual, 2, kCameraCount, kOwnCount, kPoseCount,
                                         kSheetCount>(new GeometryResidual(view, point, panel));
}

ceres::CostFunction* phase_cost(const View& view, const PhaseObservation& seen,
                                const optics::Panel& panel, const std::vector<KnotWeight>& knots) {
  return new PhaseCost(view, seen, panel, knots);
}

ceres::CostFunction* linear_cost(const std::vector<double>& weights, double sigma) {
  return new LinearCost(weights, sigma);
}

void add_camera_priors(ceres::Problem& problem, const View& view, double* camera) {
  const double width = view.picture_width;
  const CameraValues prior = {0.9 * width, 0.5 * width, 0.5 * view.picture_height, 0.0, 0.0};
  const CameraValues sigma = {0.5 * width, 0.05 * width, 0.05 * width, 0.2, 0.2};
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CameraPrior, kCameraCount, kCameraCount>(
                               new CameraPrior(prior, sigma)),
                           nullptr, camera);
}

void add_own_camera_priors(ceres::Problem& problem, double* own, double factor) {
  const ceres::Vector sigmas =
      factor * Eigen::Vector3d(kOwnFocalSigma, kOwnCentreSigma, kOwnCentreSigma);
  const ceres::Matrix weights = sigmas.cwiseInverse().asDiagonal();
  problem.AddResidualBlock(new ceres::NormalPrior(weights, ceres::Vector::Zero(kOwnCount)), nullptr,
                           own);
}

}  // namespace lenticule::calib
