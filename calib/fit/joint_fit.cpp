// SPDX-License-Identifier: Apache-2.0
// Both fits are least squares by Ceres over the terms below. The poses come first, from
// homographies and several focal lengths, with the sheet held. The joint fit frees all: sheet, map,
// camera and poses. A phase is known up to whole lenses, so the start must be right within half a
// lens: the candidate of the gap gives it. The standard errors of phases and panel points are
// rescaled by their residuals and the fit is repeated, since the scatter inside a block omits
// errors that change from block to block. The inverse of the normal equations is the covariance.
#include "calib/fit/joint_fit.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/statistics.h"
#include "calib/linear_algebra.h"
#include "calib/measure/panel_map.h"

namespace lenticule::calib {
namespace {

// The least-squares terms for Ceres. The caller owns a returned term and gives it to a problem.

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

/// Makes a geometry term. Parameter blocks: camera, own camera, pose, sheet. Two residuals: the
/// panel point of the model at the camera pixel minus the decoded panel point, in standard errors.
ceres::CostFunction* geometry_cost(const View& view, const GeometryPoint& point,
                                   const optics::Panel& panel) {
  return new ceres::AutoDiffCostFunction<GeometryResidual, 2, kCameraCount, kOwnCount, kPoseCount,
                                         kSheetCount>(new GeometryResidual(view, point, panel));
}

/// Makes a phase term. Parameter blocks: camera, own camera, pose, sheet, and one number for each
/// knot weight.
/// One residual: the observed phase minus the model's, without whole turns, in standard errors.
ceres::CostFunction* phase_cost(const View& view, const PhaseObservation& seen,
                                const optics::Panel& panel, const std::vector<KnotWeight>& knots) {
  return new PhaseCost(view, seen, panel, knots);
}

/// Makes a linear term. Parameter blocks: one number for each weight. One residual: their weighted
/// sum, over sigma.
ceres::CostFunction* linear_cost(const std::vector<double>& weights, double sigma) {
  return new LinearCost(weights, sigma);
}

/// Adds weak priors that hold for any camera: focal length, centre, little distortion.
void add_camera_priors(ceres::Problem& problem, const View& view, double* camera) {
  const double width = view.picture_width;
  const CameraValues prior = {0.9 * width, 0.5 * width, 0.5 * view.picture_height, 0.0, 0.0};
  const CameraValues sigma = {0.5 * width, 0.05 * width, 0.05 * width, 0.2, 0.2};
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CameraPrior, kCameraCount, kCameraCount>(
                               new CameraPrior(prior, sigma)),
                           nullptr, camera);
}

/// Adds the priors of a view's own camera, with standard deviations that are larger by a factor.
void add_own_camera_priors(ceres::Problem& problem, double* own, double factor = 1.0) {
  const ceres::Vector sigmas =
      factor * Eigen::Vector3d(kOwnFocalSigma, kOwnCentreSigma, kOwnCentreSigma);
  const ceres::Matrix weights = sigmas.cwiseInverse().asDiagonal();
  problem.AddResidualBlock(new ceres::NormalPrior(weights, ceres::Vector::Zero(kOwnCount)), nullptr,
                           own);
}

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

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kCauchy = 4.0;  ///< standard errors
constexpr double kHuber = 3.0;   ///< standard errors
/// Lenses: mean and slopes of the map. So tight that they add nothing to the errors of the sheet.
constexpr double kGaugeSigma = 3e-6;
/// Focused cylinders have up to a twentieth of either.
constexpr double kAberrationSigma = 0.05;
constexpr double kSagSigma = 0.05;
constexpr double kAnyAmount = 20.0;  ///< factor on the priors of JointOptions::only_view

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// Bundle is one fit with everything that it borrows; used once.
class Bundle {
 public:
  Bundle(const std::vector<View>& views, const PoseFit& poses, const SheetStart& start,
         const optics::Panel& panel, const JointOptions& options)
      : views_(views), panel_(panel), options_(options), start_(start) {
    fit_.values.camera = poses.camera;
    fit_.values.own = poses.own;
    fit_.values.poses = poses.poses;
    fit_.values.sheet = start.values;
    fit_.values.knots.assign(static_cast<size_t>(options.grid.count()), 0.0);
  }

  std::optional<JointFit> run(const std::optional<GapCandidate>& gap) {
    if (gap) {
      fit_.values.sheet[kGap] = gap->gap_mm;
      fit_.values.sheet[kShape] = gap->shape;
    }
    if (!start_linear(gap)) return std::nullopt;
    if (!solve()) return std::nullopt;
    fit_.cost = cost_;
    rescale();
    if (!solve()) return std::nullopt;
    finish();
    return std::move(fit_);
  }

 private:
  [[nodiscard]] CameraValues camera_in(size_t v) const {
    return camera_of(fit_.values.camera, fit_.values.own[v], views_[v]);
  }
  [[nodiscard]] bool frees_own_camera(size_t v) const {
    return options_.free_poses && options_.sameness == CameraSameness::Nearly &&
           v == options_.only_view.value_or(v);
  }

  /// Computes pitch, slant and offset by linear least squares from the views, for a given gap.
  bool start_linear(const std::optional<GapCandidate>& gap) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    const double half_width = 0.5 * panel_.width_px * panel_.pixel_width.value;
    const double half_height = 0.5 * panel_.height_px * panel_.pixel_height.value;
    for (size_t v = 0; v < views_.size(); ++v) {
      const PoseValues& pose = fit_.values.poses[v];
      const CameraValues camera = camera_in(v);
      for (const PhaseObservation& p : views_[v].phases) {
        const auto lens =
            lens_plane_point(camera.data(), pose.data(), p.camera_px.x, p.camera_px.y);
        const auto q = fringe_point(pose.data(), fit_.values.sheet.data(), panel_, lens);
        const double whole = gap ? gap->whole_lenses[v] : 0;
        const double shown = fringe_turns(views_[v].fringe, panel_, q) - p.turns + whole;
        const Eigen::Vector3d row(lens.x / half_width, -lens.y / half_height, 1.0);
        normal += row * row.transpose();
        right += shown * row;
      }
    }
    const Eigen::Vector3d solution = solve_symmetric(normal, right);
    if (!solution.allFinite() || !(solution[0] > 0.0)) return false;
    fit_.values.sheet[kAcross] = solution[0];
    fit_.values.sheet[kDown] = solution[1];
    fit_.values.sheet[kOffset] = solution[2];
    return true;
  }

  void build() {
    problem_ = std::make_unique<ceres::Problem>();
    FitValues& values = fit_.values;
    for (size_t v = 0; v < views_.size(); ++v) {
      if (options_.free_poses) add_geometry(v);
      add_phases(v);
      double* const own = values.own[v].data();
      if (frees_own_camera(v))
        add_own_camera_priors(*problem_, own, options_.only_view ? kAnyAmount : 1.0);
      else
        problem_->SetParameterBlockConstant(own);
    }
    if (options_.free_poses) add_distances();
    if (options_.free_poses) add_camera_priors(*problem_, views_.front(), values.camera.data());
    add_map_terms();
    add_sheet_priors();
  }

  void add_geometry(size_t v) {
    for (GeometryPoint point : views_[v].geometry) {
      point.sigma_px *= geometry_scale_;
      problem_->AddResidualBlock(geometry_cost(views_[v], point, panel_),
                                 new ceres::HuberLoss(kHuber), fit_.values.camera.data(),
                                 fit_.values.own[v].data(), fit_.values.poses[v].data(),
                                 fit_.values.sheet.data());
    }
  }

  void add_distances() {
    const size_t known = std::min(options_.distances_mm.size(), views_.size());
    for (size_t v = 0; v < known; ++v) {
      const Estimate& distance = options_.distances_mm[v];
      if (!(distance.value > 0.0)) continue;
      Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(1, kPoseCount);
      Eigen::VectorXd wanted = Eigen::VectorXd::Zero(kPoseCount);
      weight(0, kPupil + 2) = 1.0 / distance.sigma;
      wanted[kPupil + 2] = distance.value;
      problem_->AddResidualBlock(new ceres::NormalPrior(weight, wanted), nullptr,
                                 fit_.values.poses[v].data());
    }
  }

  void add_phases(size_t v) {
    const CameraValues camera = camera_in(v);
    for (PhaseObservation seen : views_[v].phases) {
      const auto lens = lens_plane_point(camera.data(), fit_.values.poses[v].data(),
                                         seen.camera_px.x, seen.camera_px.y);
      seen.sigma *= fit_.phase_scale;
      const std::vector<KnotWeight> knots = knots_at(lens);
      std::vector<double*> blocks = {fit_.values.camera.data(), fit_.values.own[v].data(),
                                     fit_.values.poses[v].data(), fit_.values.sheet.data()};
      for (const KnotWeight& k : knots)
        blocks.push_back(&fit_.values.knots[static_cast<size_t>(k.knot)]);
      problem_->AddResidualBlock(phase_cost(views_[v], seen, panel_, knots),
                                 new ceres::CauchyLoss(kCauchy), blocks);
    }
    if (!options_.free_poses) {
      problem_->SetParameterBlockConstant(fit_.values.camera.data());
      problem_->SetParameterBlockConstant(fit_.values.poses[v].data());
    }
  }

  [[nodiscard]] std::vector<KnotWeight> knots_at(const PlanePoint<double>& lens) const {
    if (options_.grid.count() == 0) return {};
    return knot_weights(options_.grid, {panel_.x_px(lens.x), panel_.y_px(lens.y)}, panel_.width_px,
                        panel_.height_px);
  }

  double* knot(int column, int row) {
    return &fit_.values.knots[static_cast<size_t>(row * options_.grid.columns + column)];
  }

  /// Adds the terms of the map, which is smooth and has neither mean nor slopes, since those are
  /// offset, pitch and slant.
  void add_map_terms() {
    const KnotGrid& grid = options_.grid;
    const std::vector<double> bend = {1.0, -2.0, 1.0};
    for (int y = 0; y < grid.rows; ++y)
      for (int x = 1; x + 1 < grid.columns; ++x)
        add_linear({knot(x - 1, y), knot(x, y), knot(x + 1, y)}, bend, options_.bend_sigma);
    for (int x = 0; x < grid.columns; ++x)
      for (int y = 1; y + 1 < grid.rows; ++y)
        add_linear({knot(x, y - 1), knot(x, y), knot(x, y + 1)}, bend, options_.bend_sigma);
    for (int term = 0; term < 3 && grid.count() > 0; ++term) add_gauge(term);
  }

  /// Constrains the mean over the panel's area of the map times 1, x or y.
  void add_gauge(int term) {
    constexpr int kColumns = 96, kRows = 56;
    std::vector<double> weights(fit_.values.knots.size(), 0.0);
    for (int n = 0; n < kColumns * kRows; ++n) {
      const double x = (n % kColumns + 0.5) / kColumns, y = (n / kColumns + 0.5) / kRows;
      const double factor = term == 0 ? 1.0 : 2.0 * (term == 1 ? x : y) - 1.0;
      for (const KnotWeight& k :
           knot_weights(options_.grid, {x * panel_.width_px, y * panel_.height_px}, panel_.width_px,
                        panel_.height_px))
        weights[static_cast<size_t>(k.knot)] += k.weight * factor / (kColumns * kRows);
    }
    std::vector<double*> blocks;
    for (double& value : fit_.values.knots) blocks.push_back(&value);
    add_linear(blocks, weights, kGaugeSigma);
  }

  void add_linear(const std::vector<double*>& blocks, const std::vector<double>& weights,
                  double sigma) {
    problem_->AddResidualBlock(linear_cost(weights, sigma), nullptr, blocks);
  }

  /// Holds gap and shape, or adds weak priors for them.
  void add_sheet_priors() {
    double* const sheet = fit_.values.sheet.data();
    if (!options_.free_gap) {
      problem_->SetManifold(
          sheet, new ceres::SubsetManifold(kSheetCount, {kGap, kShape, kAberration, kSag}));
      return;
    }
    Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(4, kSheetCount);
    weight(0, kGap) = 1.0 / (start_.gap_tolerance * start_.values[kGap]);
    weight(1, kShape) = 1.0 / start_.shape_tolerance;
    weight(2, kAberration) = 1.0 / kAberrationSigma;
    weight(3, kSag) = 1.0 / kSagSigma;
    const Eigen::Map<const Eigen::Matrix<double, kSheetCount, 1>> prior(start_.values.data());
    problem_->AddResidualBlock(new ceres::NormalPrior(weight, prior), nullptr, sheet);
    problem_->SetParameterLowerBound(sheet, kGap, 0.02 * start_.values[kGap]);
    problem_->SetParameterLowerBound(sheet, kShape, 0.0);
    problem_->SetParameterUpperBound(sheet, kShape, 1.0);
  }

  bool solve() {
    build();
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.max_num_iterations = options_.most_rounds;
    options.function_tolerance = 1e-9;
    options.parameter_tolerance = 1e-12;
    options.num_threads = 2;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem_.get(), &summary);
    cost_ = summary.final_cost;
    return summary.IsSolutionUsable();
  }

  /// Rescales the standard errors: the scatter inside blocks does not include errors that change
  /// from block to block, but the fit's residuals do.
  void rescale() {
    std::vector<double> normalized, geometry;
    for (size_t v = 0; v < views_.size(); ++v) {
      const std::vector<double> rests = phase_rests(v);
      for (size_t n = 0; n < rests.size(); ++n)
        normalized.push_back(rests[n] / views_[v].phases[n].sigma);
      const std::vector<double> seen = geometry_rests(v);
      geometry.insert(geometry.end(), seen.begin(), seen.end());
    }
    fit_.phase_scale = std::max(0.05, 1.4826 * median_magnitude(normalized));
    if (options_.free_poses)
      geometry_scale_ =
          options_.geometry_scatter * std::max(0.05, 1.4826 * median_magnitude(geometry));
  }

  [[nodiscard]] std::vector<double> phase_rests(size_t v) const {
    return rests_of(views_[v], fit_.values.own[v], fit_.values.poses[v], fit_.values, options_.grid,
                    panel_);
  }

  /// Returns the residuals of both coordinates of each geometry point, in its standard errors.
  [[nodiscard]] std::vector<double> geometry_rests(size_t v) const {
    std::vector<double> out;
    for (const GeometryPoint& point : views_[v].geometry) {
      const std::unique_ptr<ceres::CostFunction> cost(geometry_cost(views_[v], point, panel_));
      const std::array<const double*, 4> blocks = {
          fit_.values.camera.data(), fit_.values.own[v].data(), fit_.values.poses[v].data(),
          fit_.values.sheet.data()};
      std::array<double, 2> rest{};
      if (cost->Evaluate(blocks.data(), rest.data(), nullptr))
        out.insert(out.end(), rest.begin(), rest.end());
    }
    return out;
  }

  void finish() {
    std::vector<double> all, geometry;
    for (size_t v = 0; v < views_.size(); ++v) {
      fit_.rests.push_back(phase_rests(v));
      all.insert(all.end(), fit_.rests.back().begin(), fit_.rests.back().end());
      for (const double rest : geometry_rests(v))
        geometry.push_back(rest * views_[v].geometry.front().sigma_px);
    }
    fit_.phase_rms = rms(all);
    fit_.geometry_rms_px = rms(geometry);
    if (options_.free_poses) fit_.covariance = covariance();
  }

  /// Returns the inverse of the normal equations of sheet, knots and poses.
  [[nodiscard]] MatrixXd covariance() {
    std::vector<double*> blocks = {fit_.values.sheet.data()};
    for (double& k : fit_.values.knots) blocks.push_back(&k);
    for (PoseValues& pose : fit_.values.poses) blocks.push_back(pose.data());
    blocks.push_back(fit_.values.camera.data());
    for (size_t v = 0; v < views_.size(); ++v)
      if (frees_own_camera(v)) blocks.push_back(fit_.values.own[v].data());
    // A held parameter has no column, so its variance stays zero.
    return spread(inverse_of_normal_equations(*problem_, blocks));
  }

  /// Expands the columns that Ceres evaluates, which exclude held parameters, to all parameters.
  [[nodiscard]] MatrixXd spread(const MatrixXd& inner) const {
    std::vector<Eigen::Index> place;
    const Eigen::Index all = kSheetCount + static_cast<Eigen::Index>(fit_.values.knots.size()) +
                             kPoseCount * static_cast<Eigen::Index>(views_.size());
    for (Eigen::Index k = 0; k < all; ++k) {
      const bool held_sheet = !options_.free_gap && k >= kGap && k < kSheetCount;
      if (!held_sheet) place.push_back(k);
    }
    MatrixXd outer = MatrixXd::Zero(all, all);
    for (size_t a = 0; a < place.size(); ++a)
      for (size_t b = 0; b < place.size(); ++b)
        outer(place[a], place[b]) =
            inner(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    return outer;
  }

  const std::vector<View>& views_;
  const optics::Panel& panel_;
  JointOptions options_;
  SheetStart start_;
  JointFit fit_;
  double geometry_scale_ = 1.0;
  double cost_ = 0.0;
  std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace

std::vector<double> rests_of(const View& view, const OwnCameraValues& own, const PoseValues& pose,
                             const FitValues& values, const KnotGrid& grid,
                             const optics::Panel& panel) {
  const CameraValues camera = camera_of(values.camera, own, view);
  std::vector<double> rests;
  for (const PhaseObservation& seen : view.phases) {
    const auto lens =
        lens_plane_point(camera.data(), pose.data(), seen.camera_px.x, seen.camera_px.y);
    const auto q = fringe_point(pose.data(), values.sheet.data(), panel, lens);
    double lambda = lens_coordinate(values.sheet.data(), panel, lens);
    if (grid.count() > 0)
      for (const KnotWeight& k : knot_weights(grid, {panel.x_px(lens.x), panel.y_px(lens.y)},
                                              panel.width_px, panel.height_px))
        lambda += k.weight * values.knots[static_cast<size_t>(k.knot)];
    const double rest = seen.turns - (fringe_turns(view.fringe, panel, q) - lambda);
    rests.push_back(rest - std::round(rest));
  }
  return rests;
}

std::optional<JointFit> fit_jointly(const std::vector<View>& views, const PoseFit& poses,
                                    const SheetStart& start, const std::optional<GapCandidate>& gap,
                                    const optics::Panel& panel, const JointOptions& options) {
  return Bundle(views, poses, start, panel, options).run(gap);
}

}  // namespace lenticule::calib
