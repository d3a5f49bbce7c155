// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/photo_pose.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "base/error.h"

namespace lenticule::calib {
namespace {

/// Standard error of the corners in the picture: generous, since a tag of which only the outline
/// could be used has edges as coarse as lenses.
constexpr double kCornerSigmaPx = 0.3;

/// Standard deviation of a camera's axis from the middle of its picture, in longer sides.
constexpr double kAxisSigma = 0.015;

struct Corner {
  Vec2 pixel;
  Vec2 panel_mm;
  Vec2 from_middle_mm;  ///< position relative to the middle of its tag
};

/// Unknowns are the parameters of the fit.
struct Unknowns {
  /// Log of the focal length; distortion; relative enlargement of all tags (light spills over the
  /// edges of dark areas); offset of the axis from the picture's middle, in longer sides.
  std::array<double, 5> lens{};
  std::array<double, 3> rotation{};  // panel_from_camera, angle times axis
  std::array<double, 3> eye{};
};

/// Seen computes the panel point in a direction of the panel frame, millimetres.
template <class T>
struct Seen {
  T lens[2];
  T panel[2];
};

template <class T>
Seen<T> seen_along(const T direction[3], const T eye[3], double gap, double shape) {
  Seen<T> seen;
  const T steps = -eye[2] / direction[2];
  T r[2];
  for (int i = 0; i < 2; ++i) {
    seen.lens[i] = eye[i] + steps * direction[i];
    r[i] = eye[i] - seen.lens[i];
  }
  using std::sqrt;
  const T depth = sqrt(eye[2] * eye[2] + (1.0 - shape) * (r[0] * r[0] + r[1] * r[1]));
  for (int i = 0; i < 2; ++i) seen.panel[i] = seen.lens[i] - gap * r[i] / depth;
  return seen;
}

/// Computes the direction in which a pixel looks, camera frame: x right, y up, z backwards.
template <class T>
void camera_direction(const T from_axis[2], const T& focal, const T& distortion, T out[3]) {
  const T u = from_axis[0] / focal, v = -from_axis[1] / focal;
  const T stretch = 1.0 + distortion * (u * u + v * v);
  out[0] = u * stretch;
  out[1] = v * stretch;
  out[2] = T(-1.0);
}

struct CornerError {
  Corner corner;
  Vec2 middle_px;
  double longer_px;
  double gap, shape, weight;

  template <class T>
  bool operator()(const T* lens, const T* rotation, const T* eye, T* residual) const {
    using std::exp;
    T in_camera[3], in_panel[3];
    const T from_axis[2] = {corner.pixel.x - middle_px.x - lens[3] * longer_px,
                            corner.pixel.y - middle_px.y - lens[4] * longer_px};
    camera_direction(from_axis, T(exp(lens[0])), lens[1], in_camera);
    ceres::AngleAxisRotatePoint(rotation, in_camera, in_panel);
    if (!(in_panel[2] < -1e-3) || !(eye[2] > 1.0)) return false;  // looks past the panel
    const Seen<T> seen = seen_along(in_panel, eye, gap, shape);
    const T& larger = lens[2];
    residual[0] = (seen.panel[0] - corner.panel_mm.x - larger * corner.from_middle_mm.x) * weight;
    residual[1] = (seen.panel[1] - corner.panel_mm.y - larger * corner.from_middle_mm.y) * weight;
    return true;
  }
};

/// Prior is the term (parameter[index] - value) / sigma.
struct Prior {
  int index;
  double value, sigma;
  template <class T>
  bool operator()(const T* parameter, T* residual) const {
    residual[0] = (parameter[index] - value) / sigma;
    return true;
  }
};

std::vector<Corner> corners_of(const std::vector<TagSighting>& tags,
                               const SinglePhotoChart& chart) {
  std::vector<Corner> corners;
  const optics::Panel& panel = chart.start.panel;
  for (const TagSighting& tag : tags) {
    const ChartTag* drawn = chart.tag(tag.id);
    LENTICULE_CHECK(drawn != nullptr);
    const auto on_panel = drawn->corners_px();
    const Vec2 diagonal = on_panel[0] + on_panel[2];  // its middle, times two
    for (size_t i = 0; i < on_panel.size(); ++i) {
      const Vec2 at{panel.x_mm(on_panel[i].x), panel.y_mm(on_panel[i].y)};
      const Vec2 middle{panel.x_mm(0.5 * diagonal.x), panel.y_mm(0.5 * diagonal.y)};
      corners.push_back({tag.corners_px[i], at, at - middle});
    }
  }
  return corners;
}

/// Similarity is picture = scale e^(i angle) panel + shift, y up in both, as complex numbers.
struct Similarity {
  std::complex<double> factor;  // pixels per millimetre
  std::complex<double> shift;
};

Similarity fit_similarity(const std::vector<Corner>& corners) {
  std::complex<double> mean_panel, mean_picture, product;
  double squares = 0.0;
  const double share = 1.0 / static_cast<double>(corners.size());
  for (const Corner& c : corners) {
    mean_panel += share * std::complex(c.panel_mm.x, c.panel_mm.y);
    mean_picture += share * std::complex(c.pixel.x, -c.pixel.y);
  }
  for (const Corner& c : corners) {
    const auto panel = std::complex(c.panel_mm.x, c.panel_mm.y) - mean_panel;
    product += (std::complex(c.pixel.x, -c.pixel.y) - mean_picture) * std::conj(panel);
    squares += std::norm(panel);
  }
  const std::complex<double> factor = product / squares;
  return {factor, mean_picture - factor * mean_panel};
}

struct PosePriors {
  Estimate log_focal;
  Estimate distance_mm;
  double axis_sigma = kAxisSigma;  ///< standard deviation of its position, in longer sides
};

PosePriors pose_priors_of(const PhotoPriors& priors, const SinglePhotoChart& chart,
                          int longer_side) {
  const double line = chart.start.viewing.distance.value;
  const double distance = std::isfinite(line) ? line : 700.0;
  PosePriors pose_priors{{std::log(0.85 * longer_side), std::log(1.5)}, {distance, 0.1 * distance}};
  if (priors.focal_px)
    pose_priors.log_focal = {std::log(priors.focal_px->value),
                             priors.focal_px->sigma / priors.focal_px->value};
  if (priors.distance_mm) pose_priors.distance_mm = *priors.distance_mm;
  return pose_priors;
}

/// Returns weaker priors, in which every value without confirmation may be a tenth off. Distance
/// and focal length confirm each other if both are known.
PosePriors doubted(PosePriors pose_priors, const PhotoPriors& priors) {
  constexpr double kDoubt = 0.1;
  pose_priors.axis_sigma = kDoubt;
  if (priors.focal_px && priors.distance_mm) return pose_priors;
  pose_priors.log_focal.sigma = std::max(pose_priors.log_focal.sigma, kDoubt);
  pose_priors.distance_mm.sigma =
      std::max(pose_priors.distance_mm.sigma, kDoubt * pose_priors.distance_mm.value);
  return pose_priors;
}

Unknowns first_guess(const Similarity& similarity, const PosePriors& pose_priors, Vec2 middle_px) {
  Unknowns guess;
  // The initial eye is straight ahead of the panel point in the middle of the picture, rotated like
  // the picture.
  const std::complex<double> at =
      (std::complex(middle_px.x, -middle_px.y) - similarity.shift) / similarity.factor;
  guess.eye = {at.real(), at.imag(), pose_priors.distance_mm.value};
  guess.rotation = {0.0, 0.0, -std::arg(similarity.factor)};
  guess.lens = {std::log(std::abs(similarity.factor) * pose_priors.distance_mm.value)};
  return guess;
}

void add_corners(ceres::Problem& problem, Unknowns& unknowns, const std::vector<Corner>& corners,
                 const optics::LensSheet& sheet, Vec2 middle_px, double pixels_per_mm) {
  using Cost = ceres::AutoDiffCostFunction<CornerError, 2, 5, 3, 3>;
  const double longer_px = 2.0 * std::max(middle_px.x, middle_px.y);
  for (const Corner& corner : corners)
    problem.AddResidualBlock(
        new Cost(new CornerError{corner, middle_px, longer_px, sheet.gap.value,
                                 sheet.refraction_shape, pixels_per_mm / kCornerSigmaPx}),
        new ceres::CauchyLoss(3.0), unknowns.lens.data(), unknowns.rotation.data(),
        unknowns.eye.data());
}

void add_priors(ceres::Problem& problem, Unknowns& unknowns, const PosePriors& pose_priors) {
  using OnLens = ceres::AutoDiffCostFunction<Prior, 1, 5>;
  using OnEye = ceres::AutoDiffCostFunction<Prior, 1, 3>;
  constexpr double kDistortionSigma = 0.1, kLargerSigma = 0.1;
  problem.AddResidualBlock(
      new OnLens(new Prior{0, pose_priors.log_focal.value, pose_priors.log_focal.sigma}), nullptr,
      unknowns.lens.data());
  problem.AddResidualBlock(new OnLens(new Prior{1, 0.0, kDistortionSigma}), nullptr,
                           unknowns.lens.data());
  problem.AddResidualBlock(new OnLens(new Prior{2, 0.0, kLargerSigma}), nullptr,
                           unknowns.lens.data());
  for (const int axis : {3, 4})
    problem.AddResidualBlock(new OnLens(new Prior{axis, 0.0, pose_priors.axis_sigma}), nullptr,
                             unknowns.lens.data());
  problem.AddResidualBlock(
      new OnEye(new Prior{2, pose_priors.distance_mm.value, pose_priors.distance_mm.sigma}),
      nullptr, unknowns.eye.data());
}

bool solve(ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 100;
  options.logging_type = ceres::SILENT;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.IsSolutionUsable();
}

/// Returns the covariance row by row; NaN if it cannot be determined.
std::array<double, 9> eye_covariance(ceres::Problem& problem, const Unknowns& unknowns) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(options);
  std::array<double, 9> eye{};
  const double* block = unknowns.eye.data();
  const std::vector<const double*> wanted = {block};
  if (!covariance.Compute(wanted, &problem) ||
      !covariance.GetCovarianceBlock(block, block, eye.data()))
    eye.fill(std::numeric_limits<double>::quiet_NaN());
  return eye;
}

PhotoPose pose_of(const Unknowns& unknowns, Vec2 middle_px) {
  PhotoPose pose;
  pose.focal_px = std::exp(unknowns.lens[0]);
  pose.distortion = unknowns.lens[1];
  pose.tags_larger = unknowns.lens[2];
  const double longer_px = 2.0 * std::max(middle_px.x, middle_px.y);
  pose.middle_px = middle_px + Vec2{unknowns.lens[3], unknowns.lens[4]} * longer_px;
  ceres::AngleAxisToRotationMatrix(unknowns.rotation.data(),
                                   ceres::RowMajorAdapter3x3(pose.panel_from_camera.data()));
  pose.eye_mm = {unknowns.eye[0], unknowns.eye[1], unknowns.eye[2]};
  const double cosine = std::clamp(pose.panel_from_camera[8], -1.0, 1.0);
  pose.tilt_degrees = std::acos(cosine) * 180.0 / std::numbers::pi;
  return pose;
}

/// Returns the distance of a tag's corner from its position under the pose, picture pixels.
double corner_off_px(const PhotoPose& pose, const Corner& corner, const optics::Rig& rig,
                     double pixels_per_mm) {
  const Vec2 expected = corner.panel_mm + corner.from_middle_mm * pose.tags_larger;
  const auto seen = pose.seen_point(corner.pixel, rig);
  if (!seen) return std::numeric_limits<double>::infinity();
  return pixels_per_mm * std::hypot(rig.panel.x_mm(seen->panel_px.x) - expected.x,
                                    rig.panel.y_mm(seen->panel_px.y) - expected.y);
}

void measure_corners(PhotoPose& pose, const std::vector<Corner>& corners, const optics::Rig& rig,
                     double pixels_per_mm) {
  constexpr size_t kCornersPerTag = 4;
  double squares = 0.0;
  pose.tag_off_px.assign(corners.size() / kCornersPerTag, 0.0);
  for (size_t i = 0; i < corners.size(); ++i) {
    const double off = corner_off_px(pose, corners[i], rig, pixels_per_mm);
    double& of_tag = pose.tag_off_px[i / kCornersPerTag];
    of_tag = std::max(of_tag, off);
    squares += off * off;
  }
  pose.corner_rms_px = std::sqrt(squares / static_cast<double>(corners.size()));
}

}  // namespace

std::optional<SheetPoint> PhotoPose::seen_point(Vec2 pixel, const optics::Rig& rig) const {
  double in_camera[3], in_panel[3];
  const double from_axis[2] = {pixel.x - middle_px.x, pixel.y - middle_px.y};
  camera_direction(from_axis, focal_px, distortion, in_camera);
  for (size_t row = 0; row < 3; ++row)
    in_panel[row] = panel_from_camera[3 * row] * in_camera[0] +
                    panel_from_camera[3 * row + 1] * in_camera[1] +
                    panel_from_camera[3 * row + 2] * in_camera[2];
  if (!(in_panel[2] < -1e-3)) return std::nullopt;
  const double eye[3] = {eye_mm.x, eye_mm.y, eye_mm.z};
  const Seen<double> seen =
      seen_along(in_panel, eye, rig.sheet.gap.value, rig.sheet.refraction_shape);
  const optics::Panel& panel = rig.panel;
  return SheetPoint{{panel.x_px(seen.lens[0]), panel.y_px(seen.lens[1])},
                    {panel.x_px(seen.panel[0]), panel.y_px(seen.panel[1])}};
}

std::optional<PhotoPose> find_pose(const std::vector<TagSighting>& tags,
                                   const SinglePhotoChart& chart, int width, int height,
                                   const PhotoPriors& priors) {
  LENTICULE_CHECK(tags.size() >= 4);
  const std::vector<Corner> corners = corners_of(tags, chart);
  const Vec2 middle_px{0.5 * width, 0.5 * height};
  const PosePriors pose_priors = pose_priors_of(priors, chart, std::max(width, height));
  const Similarity similarity = fit_similarity(corners);
  const double pixels_per_mm = std::abs(similarity.factor);
  if (!(pixels_per_mm > 1e-6)) return std::nullopt;
  Unknowns unknowns = first_guess(similarity, pose_priors, middle_px);
  ceres::Problem problem;
  add_corners(problem, unknowns, corners, chart.start.sheet, middle_px, pixels_per_mm);
  add_priors(problem, unknowns, pose_priors);
  if (!solve(problem)) return std::nullopt;
  PhotoPose pose = pose_of(unknowns, middle_px);
  if (!is_finite(pose.eye_mm) || !(pose.eye_mm.z > chart.start.sheet.gap.value))
    return std::nullopt;
  const std::array<double, 9> eye = eye_covariance(problem, unknowns);
  pose.eye_sigma_mm = {std::sqrt(eye[0]), std::sqrt(eye[4]), std::sqrt(eye[8])};
  ceres::Problem loose;
  add_corners(loose, unknowns, corners, chart.start.sheet, middle_px, pixels_per_mm);
  add_priors(loose, unknowns, doubted(pose_priors, priors));
  pose.doubted_eye = eye_covariance(loose, unknowns);
  pose.prior_pull =
      std::hypot((unknowns.lens[0] - pose_priors.log_focal.value) / pose_priors.log_focal.sigma,
                 (unknowns.eye[2] - pose_priors.distance_mm.value) / pose_priors.distance_mm.sigma);
  pose.axis_pull = std::hypot(unknowns.lens[3], unknowns.lens[4]) / kAxisSigma;
  measure_corners(pose, corners, chart.start, pixels_per_mm);
  return pose;
}

}  // namespace lenticule::calib
