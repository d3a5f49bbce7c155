// SPDX-License-Identifier: Apache-2.0
// Both fits are least squares by Ceres over the terms below. The poses come first, from
// homographies and several focal lengths, with the sheet held. The joint fit frees all: sheet, map,
// camera and poses. A phase is known up to whole lenses, so the start must be right within half a
// lens: the candidate of the gap gives it. The standard errors of phases and panel points are
// rescaled by their residuals and the fit is repeated, since the scatter inside a block omits
// errors that change from block to block. The inverse of the normal equations is the covariance.
#include "calib/fit/joint_fit.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "calib/fit/projection.h"
#include "calib/linear_algebra.h"
#include "calib/measure/fringe_phase.h"

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

/// PhaseCost is the phase term: the observed phase minus the model's, without whole turns, in
/// standard errors. Parameter blocks: camera, own camera, pose, sheet, and one number for each knot
/// weight. Derivatives of the model parameters by dual numbers, of the knots analytically.
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

/// LinearCost is the weighted sum of its parameter blocks, one number each, over sigma.
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

/// Makes a geometry term. Parameter blocks: camera, own camera, pose, sheet. Two residuals: the
/// panel point of the model at the camera pixel minus the decoded panel point, in standard errors.
ceres::CostFunction* geometry_cost(const View& view, const GeometryPoint& point,
                                   const optics::Panel& panel) {
  return new ceres::AutoDiffCostFunction<GeometryResidual, 2, kCameraCount, kOwnCount, kPoseCount,
                                         kSheetCount>(new GeometryResidual(view, point, panel));
}

/// Adds weak priors that hold for any camera: focal length, centre, little distortion.
void add_camera_priors(ceres::Problem& problem, const View& view, double* camera) {
  const double width = view.picture_width;
  add_priors(problem, camera, kCameraCount,
             {{kFocal, 0.9 * width, 0.5 * width},
              {kCentreX, 0.5 * width, 0.05 * width},
              {kCentreY, 0.5 * view.picture_height, 0.05 * width},
              {kRadial1, 0.0, 0.2},
              {kRadial2, 0.0, 0.2}});
}

/// Adds the priors of a view's own camera, with standard deviations that are larger by a factor.
void add_own_camera_priors(ceres::Problem& problem, double* own, double factor = 1.0) {
  add_priors(problem, own, kOwnCount,
             {{kOwnFocal, 0.0, factor * kOwnFocalSigma},
              {kOwnCentreX, 0.0, factor * kOwnCentreSigma},
              {kOwnCentreY, 0.0, factor * kOwnCentreSigma}});
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
      add_priors(*problem_, fit_.values.poses[v].data(), kPoseCount,
                 {{kPupil + 2, distance.value, distance.sigma}});
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
      problem_->AddResidualBlock(new PhaseCost(views_[v], seen, panel_, knots),
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
    problem_->AddResidualBlock(new LinearCost(weights, sigma), nullptr, blocks);
  }

  /// Holds gap and shape, or adds weak priors for them.
  void add_sheet_priors() {
    double* const sheet = fit_.values.sheet.data();
    if (!options_.free_gap) {
      problem_->SetManifold(
          sheet, new ceres::SubsetManifold(kSheetCount, {kGap, kShape, kAberration, kSag}));
      return;
    }
    const SheetParameters& start = start_.values;
    add_priors(*problem_, sheet, kSheetCount,
               {{kGap, start[kGap], start_.gap_tolerance * start[kGap]},
                {kShape, start[kShape], start_.shape_tolerance},
                {kAberration, start[kAberration], kAberrationSigma},
                {kSag, start[kSag], kSagSigma}});
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
    outer(place, place) = inner.topLeftCorner(std::ssize(place), std::ssize(place));
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

// ---- gap

namespace {

/// Grid of the sheet's own phase, any smooth function: fine enough for real deformations.
constexpr KnotGrid kSmooth{.columns = 16, .rows = 9};
constexpr size_t kMostPerView = 700;
constexpr double kShapeStep = 0.02;
constexpr double kSmallestGapPart = 0.2;
constexpr double kLargestGapPart = 4.0;
constexpr size_t kMostCandidates = 6;

struct Row {
  size_t view = 0;
  PlanePoint<double> lens{};
  double turns = 0.0;
};

/// SmoothSheet holds all rows, and a projector that removes the part that a smooth sheet can
/// explain.
class SmoothSheet {
 public:
  SmoothSheet(const std::vector<View>& views, const PoseFit& poses, const optics::Panel& panel)
      : views_(views), poses_(poses), panel_(panel) {
    collect();
    basis_ = MatrixXd::Zero(static_cast<Eigen::Index>(rows_.size()), kSmooth.count());
    for (size_t n = 0; n < rows_.size(); ++n) {
      const Vec2 at{panel.x_px(rows_[n].lens.x), panel.y_px(rows_[n].lens.y)};
      for (const KnotWeight& k : knot_weights(kSmooth, at, panel.width_px, panel.height_px))
        basis_(static_cast<Eigen::Index>(n), k.knot) += k.weight;
    }
    MatrixXd normal = basis_.transpose() * basis_;
    normal.diagonal().array() += 1e-6 * normal.diagonal().maxCoeff();
    solver_.compute(normal);
  }

  [[nodiscard]] VectorXd project(const VectorXd& v) const {
    return v - basis_ * solver_.solve(basis_.transpose() * v);
  }

  /// Returns the lens coordinates that the rows show for a gap of zero.
  [[nodiscard]] VectorXd without_gap() const {
    return each([&](const Row& row) {
      return fringe_turns(views_[row.view].fringe, panel_, row.lens) - row.turns;
    });
  }
  /// Returns the contribution of each millimetre of gap.
  [[nodiscard]] VectorXd per_gap(double shape) const {
    return each([&](const Row& row) {
      const PoseValues& pose = poses_.poses[row.view];
      const double rx = pose[kPupil] - row.lens.x, ry = pose[kPupil + 1] - row.lens.y;
      const double part = 1.0 / std::sqrt(pose[kPupil + 2] * pose[kPupil + 2] +
                                          (1.0 - shape) * (rx * rx + ry * ry));
      return -fringe_turns(views_[row.view].fringe, panel_,
                           PlanePoint<double>{part * rx, part * ry});
    });
  }
  [[nodiscard]] VectorXd one_in_view(size_t view) const {
    return each([&](const Row& row) { return row.view == view ? 1.0 : 0.0; });
  }
  [[nodiscard]] size_t count() const { return rows_.size(); }

 private:
  void collect() {
    for (size_t v = 0; v < views_.size(); ++v) {
      const CameraValues camera = camera_of(poses_.camera, poses_.own[v], views_[v]);
      const std::vector<PhaseObservation>& phases = views_[v].phases;
      const size_t stride = std::max<size_t>(1, phases.size() / kMostPerView);
      for (size_t n = 0; n < phases.size(); n += stride)
        rows_.push_back({.view = v,
                         .lens = lens_plane_point(camera.data(), poses_.poses[v].data(),
                                                  phases[n].camera_px.x, phases[n].camera_px.y),
                         .turns = phases[n].turns});
    }
  }
  template <class Value>
  [[nodiscard]] VectorXd each(const Value& value) const {
    VectorXd v(static_cast<Eigen::Index>(rows_.size()));
    for (size_t n = 0; n < rows_.size(); ++n) v[static_cast<Eigen::Index>(n)] = value(rows_[n]);
    return v;
  }

  const std::vector<View>& views_;
  const PoseFit& poses_;
  const optics::Panel& panel_;
  std::vector<Row> rows_;
  MatrixXd basis_;
  Eigen::LDLT<MatrixXd> solver_;
};

class GapSearch {
 public:
  GapSearch(const std::vector<View>& views, const PoseFit& poses, const SheetStart& start,
            const optics::Panel& panel)
      : sheet_(views, poses, panel), start_(start), views_(views.size()) {
    base_ = sheet_.project(sheet_.without_gap());
    ones_.resize(base_.size(), static_cast<Eigen::Index>(views_) - 1);
    for (Eigen::Index v = 0; v < ones_.cols(); ++v)
      ones_.col(v) = sheet_.project(sheet_.one_in_view(static_cast<size_t>(v) + 1));
  }

  std::vector<GapCandidate> run() {
    for (double shape = 0.0; shape <= 1.0 + 1e-9; shape += kShapeStep) try_shape(shape);
    weigh();
    return std::move(found_);
  }

 private:
  /// Steps through gaps and records the whole numbers nearest to the views' remaining offsets.
  void try_shape(double shape) {
    const VectorXd per_gap = sheet_.project(sheet_.per_gap(shape));
    const double gap0 = start_.values[kGap];
    const double step = 0.02 * gap0;
    std::vector<int> before;
    for (double gap = kSmallestGapPart * gap0; gap < kLargestGapPart * gap0; gap += step) {
      const std::vector<int> wholes = lacking(base_ + gap * per_gap);
      if (wholes != before) try_wholes(wholes, per_gap, shape);
      before = wholes;
    }
  }

  /// Returns the views' offsets by least squares, rounded.
  [[nodiscard]] std::vector<int> lacking(const VectorXd& rest) const {
    const VectorXd offsets =
        solve_symmetric(ones_.transpose() * ones_, -(ones_.transpose() * rest));
    std::vector<int> wholes{0};
    for (const double offset : offsets) wholes.push_back(static_cast<int>(std::lround(offset)));
    return wholes;
  }

  void try_wholes(const std::vector<int>& wholes, const VectorXd& per_gap, double shape) {
    VectorXd rest = base_;
    for (size_t v = 1; v < views_; ++v)
      rest += wholes[v] * ones_.col(static_cast<Eigen::Index>(v) - 1);
    const double gap = -rest.dot(per_gap) / per_gap.squaredNorm();
    if (!(gap > kSmallestGapPart * start_.values[kGap] &&
          gap < kLargestGapPart * start_.values[kGap]))
      return;
    rest += gap * per_gap;
    keep({.whole_lenses = wholes,
          .gap_mm = gap,
          .shape = shape,
          .rms_lenses = std::sqrt(rest.squaredNorm() / static_cast<double>(sheet_.count()))});
  }

  /// Keeps one entry per combination: its best shape.
  void keep(const GapCandidate& candidate) {
    for (GapCandidate& known : found_) {
      if (known.whole_lenses != candidate.whole_lenses) continue;
      if (candidate.rms_lenses < known.rms_lenses) known = candidate;
      return;
    }
    found_.push_back(candidate);
  }

  void weigh() {
    double least = 1e9;
    for (const GapCandidate& c : found_) least = std::min(least, c.rms_lenses);
    least = std::max(least, 1e-4);
    for (GapCandidate& c : found_) {
      const double misfit = c.rms_lenses / least;
      const double gap = std::log(c.gap_mm / start_.values[kGap]) / start_.gap_tolerance;
      const double shape = (c.shape - start_.values[kShape]) / start_.shape_tolerance;
      c.chi_squared =
          misfit * misfit * static_cast<double>(sheet_.count()) + gap * gap + shape * shape;
    }
    std::ranges::sort(found_, {}, &GapCandidate::chi_squared);
    if (found_.size() > kMostCandidates) found_.resize(kMostCandidates);
  }

  SmoothSheet sheet_;
  SheetStart start_;
  size_t views_;
  VectorXd base_;
  MatrixXd ones_;  ///< a column for each view but the first
  std::vector<GapCandidate> found_;
};

}  // namespace

std::vector<GapCandidate> search_gaps(const std::vector<View>& views, const PoseFit& poses,
                                      const SheetStart& start, const optics::Panel& panel) {
  if (views.size() < 2) return {};
  return GapSearch(views, poses, start, panel).run();
}

// ---- search for the best fit

namespace {

/// Pulls are differences in standard deviations of the priors. Below this pull the phases change by
/// less than 0.004 lens.
constexpr double kNotablePull = 0.5;
constexpr double kMostFocalPull = 3.0;
/// A shift of the axis along the line of the places may have happened at any of them; above this
/// pull the phases could be off by more than 0.02 lens.
constexpr double kMostCentrePull = 1.6;

double focal_pull(const OwnCameraValues& own) { return std::abs(own[kOwnFocal]) / kOwnFocalSigma; }
double centre_pull(const OwnCameraValues& own) {
  return std::hypot(own[kOwnCentreX], own[kOwnCentreY]) / kOwnCentreSigma;
}
double pull(const OwnCameraValues& own) { return std::max(focal_pull(own), centre_pull(own)); }
bool zoomed(const OwnCameraValues& own) { return focal_pull(own) >= centre_pull(own); }

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
