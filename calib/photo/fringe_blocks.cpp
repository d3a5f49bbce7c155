// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/fringe_blocks.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "base/error.h"
#include "base/statistics.h"
#include "calib/linear_algebra.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

/// Standard error of the corners in the picture: generous, since a tag of which only the outline
/// could be used has edges as coarse as lenses.
constexpr double kCornerSigmaPx = 0.3;
/// That of the smooth warp which the correction of a phone's lens leaves in its pictures, in longer
/// sides. Without it, a warp looks like an axis far off the middle.
constexpr double kWarpSigma = 0.0003;

/// Standard deviation of a phone's axis from the middle of an uncropped picture, in longer sides.
/// In most phones the axis is within 0.8 %.
constexpr double kUncroppedAxisSigma = 0.006;

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
  double axis_sigma;  ///< standard deviation of its position, in longer sides
};

PosePriors pose_priors_of(const PhotoPriors& priors, const SinglePhotoChart& chart,
                          int longer_side) {
  const double distance = viewing_distance_mm(chart.start);
  PosePriors pose_priors{
      {std::log(0.85 * longer_side), std::log(1.5)}, {distance, 0.1 * distance}, priors.axis_sigma};
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
                 const optics::LensSheet& sheet, Vec2 middle_px, double pixels_per_mm,
                 bool robust = true) {
  using Cost = ceres::AutoDiffCostFunction<CornerError, 2, 5, 3, 3>;
  const double longer_px = 2.0 * std::max(middle_px.x, middle_px.y);
  const double sigma_px = std::hypot(kCornerSigmaPx, kWarpSigma * longer_px);
  for (const Corner& corner : corners)
    problem.AddResidualBlock(
        new Cost(new CornerError{corner, middle_px, longer_px, sheet.gap.value,
                                 sheet.refraction_shape, pixels_per_mm / sigma_px}),
        robust ? new ceres::CauchyLoss(3.0) : nullptr, unknowns.lens.data(),
        unknowns.rotation.data(), unknowns.eye.data());
}

void add_pose_priors(ceres::Problem& problem, Unknowns& unknowns, const PosePriors& priors) {
  constexpr double kDistortionSigma = 0.1, kLargerSigma = 0.1;
  add_priors(problem, unknowns.lens.data(), 5,
             {{0, priors.log_focal.value, priors.log_focal.sigma},
              {1, 0.0, kDistortionSigma},
              {2, 0.0, kLargerSigma},
              {3, 0.0, priors.axis_sigma},
              {4, 0.0, priors.axis_sigma}});
  add_priors(problem, unknowns.eye.data(), 3,
             {{2, priors.distance_mm.value, priors.distance_mm.sigma}});
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
std::array<double, 9> eye_covariance(ceres::Problem& problem, Unknowns& unknowns) {
  std::array<double, 9> out{};
  Eigen::Map<Eigen::Matrix3d>(out.data()) =
      inverse_of_normal_equations(
          problem, {unknowns.lens.data(), unknowns.rotation.data(), unknowns.eye.data()})
          .bottomRightCorner<3, 3>();
  return out;
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
  // All corners lead a rough start to the minimum; then those of hidden tags are outliers.
  ceres::Problem rough, problem;
  add_corners(rough, unknowns, corners, chart.start.sheet, middle_px, pixels_per_mm, false);
  add_corners(problem, unknowns, corners, chart.start.sheet, middle_px, pixels_per_mm);
  for (ceres::Problem* one : {&rough, &problem}) {
    add_pose_priors(*one, unknowns, pose_priors);
    if (!solve(*one)) return std::nullopt;
  }
  PhotoPose pose = pose_of(unknowns, middle_px);
  if (!is_finite(pose.eye_mm) || !(pose.eye_mm.z > chart.start.sheet.gap.value))
    return std::nullopt;
  const std::array<double, 9> eye = eye_covariance(problem, unknowns);
  pose.eye_sigma_mm = {std::sqrt(eye[0]), std::sqrt(eye[4]), std::sqrt(eye[8])};
  const auto eye_under = [&](const PosePriors& assumed) {
    ceres::Problem again;
    add_corners(again, unknowns, corners, chart.start.sheet, middle_px, pixels_per_mm);
    add_pose_priors(again, unknowns, assumed);
    return eye_covariance(again, unknowns);
  };
  pose.doubted_eye = eye_under(doubted(pose_priors, priors));
  PosePriors uncropped = pose_priors;
  // An axis that seems far off the middle is a sign of a warp.
  uncropped.axis_sigma = std::hypot(kUncroppedAxisSigma, unknowns.lens[3], unknowns.lens[4]);
  pose.uncropped_eye = eye_under(uncropped);
  pose.prior_pull =
      std::hypot((unknowns.lens[0] - pose_priors.log_focal.value) / pose_priors.log_focal.sigma,
                 (unknowns.eye[2] - pose_priors.distance_mm.value) / pose_priors.distance_mm.sigma);
  pose.axis_pull = std::hypot(unknowns.lens[3], unknowns.lens[4]) / priors.axis_sigma;
  measure_corners(pose, corners, chart.start, pixels_per_mm);
  return pose;
}

namespace {

constexpr int kColumns = 24;
constexpr int kRowsPerBand = 2;
constexpr int kParts = 4;  ///< parts of a block along each side
constexpr int kGreen = 1;
constexpr double kTau = 2.0 * std::numbers::pi;

/// BlockGrid assigns each panel point to its block.
class BlockGrid {
 public:
  explicit BlockGrid(const SinglePhotoChart& chart)
      : chart_(chart), rows_(kRowsPerBand * chart.bands) {}

  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] bool is_on_panel(Vec2 at) const {
    return at.x >= 0.0 && at.y >= 0.0 && at.x < width() && at.y < height();
  }
  [[nodiscard]] bool is_on_fringes(Vec2 at) const {
    const double in_band = at.y * chart_.bands / height();
    const double from_border = std::abs(in_band - std::round(in_band));
    constexpr double kMargin = 0.06;  // fraction of a band that a lens or a blurred camera may mix
    if (from_border < kMargin) return false;
    // At the sides, too, a blurred camera mixes fringes with what is beside the panel.
    const double from_side = std::min(at.x, width() - at.x) * chart_.bands / height();
    if (from_side < kMargin) return false;
    const double margin = 0.5 * chart_.tags.front().cell_px;
    const auto covers = [&](const auto& drawn) { return drawn.covers(at, margin); };
    return std::ranges::none_of(chart_.tags, covers) &&
           std::ranges::none_of(chart_.patches, covers);
  }
  [[nodiscard]] uint32_t block_at(Vec2 at) const {
    const int column = std::min(static_cast<int>(at.x * kColumns / width()), kColumns - 1);
    const int row = std::min(static_cast<int>(at.y * rows_ / height()), rows_ - 1);
    return static_cast<uint32_t>(row * kColumns + column);
  }

 private:
  [[nodiscard]] double width() const { return chart_.start.panel.width_px; }
  [[nodiscard]] double height() const { return chart_.start.panel.height_px; }

  const SinglePhotoChart& chart_;
  int rows_;
};

/// Determines the blocks with fringes on a grid of panel points, and returns their number.
double drawn_blocks(const BlockGrid& grid, const optics::Panel& panel, std::vector<bool>& drawn) {
  constexpr int kStep = 8;
  for (int y = kStep / 2; y < panel.height_px; y += kStep)
    for (int x = kStep / 2; x < panel.width_px; x += kStep)
      if (grid.is_on_fringes({double(x), double(y)}))
        drawn[grid.block_at({double(x), double(y)})] = true;
  return static_cast<double>(std::count(drawn.begin(), drawn.end(), true));
}

double covered_part(const FringeSamples& fringes, const BlockGrid& grid,
                    const optics::Panel& panel) {
  const size_t blocks = static_cast<size_t>(fringes.columns) * static_cast<size_t>(fringes.rows);
  std::vector<bool> drawn(blocks), seen(blocks);
  const double wanted = drawn_blocks(grid, panel, drawn);
  for (const FringeSample& sample : fringes.samples) seen[sample.block] = true;
  return wanted > 0.0 ? static_cast<double>(std::count(seen.begin(), seen.end(), true)) / wanted
                      : 0.0;
}

/// PatchLight sums the light of both halves of a patch.
struct PatchLight {
  std::array<double, 2> light{}, pixels{};
  double clipped = 0.0;

  /// Returns the light of the squares relative to the grey. Clipping takes more from the squares.
  [[nodiscard]] std::optional<double> squares() const {
    constexpr double kFewestPixels = 20.0, kMostClipped = 0.01;
    const double part = light[1] / pixels[1] / (light[0] / pixels[0]);
    if (std::min(pixels[0], pixels[1]) < kFewestPixels || !std::isfinite(part) ||
        clipped > kMostClipped * (pixels[0] + pixels[1]))
      return std::nullopt;
    return part;
  }
};

FringeSample sample_of(const SheetPoint& point, Vec2 pixel, float light, uint32_t block,
                       const optics::Panel& panel) {
  return {static_cast<float>(point.lens_px.x / panel.width_px - 0.5),
          static_cast<float>(point.lens_px.y / panel.height_px - 0.5),
          static_cast<float>(point.panel_px.x),
          static_cast<float>(point.panel_px.y),
          light,
          block,
          static_cast<float>(pixel.x),
          static_cast<float>(pixel.y),
          {}};
}

/// Returns the lens coordinate at a place in LensPlane's coordinates.
double lens_at(const optics::OpticalModel& model, const optics::Panel& panel, double x, double y) {
  return model.lens_coordinate((x + 0.5) * panel.width_px, (y + 0.5) * panel.height_px, kGreen);
}

/// Returns the position in the block, -1/2 to 1/2 in both directions.
Vec2 place_in_block(const FringeSample& sample, const FringeSamples& fringes,
                    const optics::Panel& panel) {
  const int column = static_cast<int>(sample.block) % fringes.columns;
  const int row = static_cast<int>(sample.block) / fringes.columns;
  return {double{sample.panel_x_px} / panel.width_px * fringes.columns - column - 0.5,
          double{sample.panel_y_px} / panel.height_px * fringes.rows - row - 0.5};
}

using LightTerms = Eigen::Matrix<double, LightSums::kLightTerms, 1>;
using LightSquare = Eigen::Matrix<double, LightSums::kLightTerms, LightSums::kLightTerms>;
using LightSides = Eigen::Matrix<double, LightSums::kLightTerms, LightSums::kSides>;

void add_sample(LightSums& sums, const FringeSample& sample, double cycles, Vec2 within) {
  LightTerms terms;
  terms << 1.0, within.x, within.y, std::cos(kTau * cycles), std::sin(kTau * cycles);
  Eigen::Matrix<double, 1, LightSums::kSides> sides;
  sides << sample.light, sample.colours[0], sample.colours[1], sample.colours[2], sample.x,
      sample.y, sample.pixel_x, sample.pixel_y;
  Eigen::Map<LightSquare>(sums.normal.data()).noalias() += terms * terms.transpose();
  Eigen::Map<LightSides>(sums.right.data()).noalias() += terms * sides;
}

/// Adds the sums of a part as they are for fringes that are ahead by some cycles.
void add_part(LightSums& sums, const LightSums& part, double cycles) {
  const double c = std::cos(kTau * cycles), s = std::sin(kTau * cycles);
  LightSquare turn = LightSquare::Identity();
  turn.bottomRightCorner<2, 2>() << c, -s, s, c;
  Eigen::Map<LightSquare>(sums.normal.data()) +=
      turn * Eigen::Map<const LightSquare>(part.normal.data()) * turn.transpose();
  Eigen::Map<LightSides>(sums.right.data()) +=
      turn * Eigen::Map<const LightSides>(part.right.data());
}

/// Returns the phase of fitted light, cycles: cos(p + r) = cos r cos p - sin r sin p.
double phase_of(const LightTerms& fitted) { return std::atan2(-fitted[4], fitted[3]) / kTau; }

/// Returns nothing if the phase of the fringes changes too little over the block.
std::optional<FringeBlock> block_of(const LightSums& sums, uint32_t block, double detuning) {
  const LightSquare inverse =
      inverse_of_symmetric(Eigen::Map<const LightSquare>(sums.normal.data()));
  const Eigen::Map<const LightSides> right(sums.right.data());
  const double count = sums.normal[0];
  const LightTerms fitted = inverse * right.col(0);
  const double amplitude = std::hypot(fitted[3], fitted[4]);
  // Variance of the phase, for light with variance 1: 2 / count if the other terms are orthogonal.
  LightTerms along = LightTerms::Zero();
  along[3] = -fitted[4] / amplitude;
  along[4] = fitted[3] / amplitude;
  const double variance = along.dot(inverse * along);
  constexpr double kLeastInformation = 0.2;
  if (!(variance > 0.0) || 2.0 / (variance * count) < kLeastInformation) return std::nullopt;
  FringeBlock out;
  out.block = block;
  out.detuning = detuning;
  out.x = right(0, 4) / count;
  out.y = right(0, 5) / count;
  out.pixel = {right(0, 6) / count, right(0, 7) / count};
  out.phase = phase_of(fitted);
  for (size_t c = 0; c < out.colour_phase.size(); ++c) {
    const auto own = right.col(static_cast<Eigen::Index>(c) + 1);
    if (own[0] <= 0.0) continue;
    const double ahead = phase_of(inverse * own) - out.phase;
    out.colour_phase[c] = ahead - std::round(ahead);
  }
  out.contrast = fitted[0] > 0.0 ? amplitude / fitted[0] : 0.0;
  out.weight = 2.0 * amplitude * amplitude / variance;
  return out;
}

}  // namespace

LensPlane plane_of(const optics::Rig& rig) {
  const double pitch = rig.sheet.pitch.value;
  return {rig.sheet.offset.value, 3.0 * rig.panel.width_px / pitch,
          3.0 * rig.sheet.slant * rig.panel.height_px / pitch};
}

optics::Rig with_plane(optics::Rig rig, const LensPlane& plane) {
  const double width = rig.panel.width_px, height = rig.panel.height_px;
  rig.sheet.pitch = Subpixels(3.0 * width / plane.across);
  rig.sheet.slant = plane.down * width / (plane.across * height);
  rig.sheet.offset = Lenses(plane.at);
  return rig;
}

FringeSamples collect_fringes(const PhotoLight& picture, const PhotoPose& pose,
                              const SinglePhotoChart& chart) {
  const BlockGrid grid(chart);
  FringeSamples out{kColumns, grid.rows(), {}, 0.0, 0.0};
  std::vector<PatchLight> patches(chart.patches.size());
  out.samples.reserve(picture.light.size());
  size_t clipped = 0, on_panel = 0;  // clipped in 255ths
  for (int j = 0; j < picture.height; ++j) {
    for (int i = 0; i < picture.width; ++i) {
      const auto point = pose.seen_point({i + 0.5, j + 0.5}, chart.start);
      if (!point || !grid.is_on_panel(point->panel_px)) continue;
      const size_t at =
          static_cast<size_t>(j) * static_cast<size_t>(picture.width) + static_cast<size_t>(i);
      const float light = picture.light[at];
      const uint8_t own_clipped = picture.clipped.empty() ? uint8_t{0} : picture.clipped[at];
      if (!grid.is_on_fringes(point->panel_px)) {
        for (size_t k = 0; k < patches.size(); ++k)
          if (const int half = chart.patches[k].half_at(point->panel_px); half >= 0) {
            patches[k].light[static_cast<size_t>(half)] += double{light};
            patches[k].pixels[static_cast<size_t>(half)] += 1.0;
            patches[k].clipped += own_clipped / 255.0;
          }
        continue;
      }
      if (!std::isfinite(light)) continue;
      ++on_panel;
      // Clipping flattens bright fringes on both sides alike, so their phase stays.
      clipped += own_clipped;
      out.samples.push_back(sample_of(*point, {i + 0.5, j + 0.5}, light,
                                      grid.block_at(point->panel_px), chart.start.panel));
      if (!picture.colours.empty()) out.samples.back().colours = picture.colours[at];
    }
  }
  if (on_panel > 0)
    out.saturated = static_cast<double>(clipped) / 255.0 / static_cast<double>(on_panel);
  out.covered = covered_part(out, grid, chart.start.panel);
  for (const PatchLight& patch : patches)
    if (const auto part = patch.squares()) out.squares = std::max(out.squares.value_or(0.0), *part);
  return out;
}

FringeSums sum_fringes(const FringeSamples& fringes, const SinglePhotoChart& chart,
                       const optics::Rig& rig) {
  FringeSums out{rig, fringes.columns, fringes.rows, {}};
  out.parts.resize(static_cast<size_t>(kParts * kParts * fringes.columns) *
                   static_cast<size_t>(fringes.rows));
  const optics::OpticalModel model(rig);
  for (const FringeSample& sample : fringes.samples) {
    const double detuning = SinglePhotoChart::detuning(fringes.band_of(sample.block, chart.bands));
    const Vec2 within = place_in_block(sample, fringes, rig.panel);
    const auto part = [](double at) {
      return static_cast<uint32_t>(
          std::clamp(static_cast<int>((at + 0.5) * kParts), 0, kParts - 1));
    };
    // Whole lenses are invisible: fringes are the comb minus the lens coordinate.
    add_sample(out.parts[(sample.block * kParts + part(within.y)) * kParts + part(within.x)],
               sample,
               chart.comb_phase(sample.panel_x_px, sample.panel_y_px, detuning) -
                   lens_at(model, rig.panel, sample.x, sample.y),
               within);
  }
  return out;
}

std::vector<FringeBlock> measure_blocks(const FringeSums& sums, const SinglePhotoChart& chart,
                                        const optics::Rig& rig) {
  const optics::OpticalModel before(sums.rig), now(rig);
  constexpr size_t kAll = size_t{kParts} * kParts;
  std::vector<LightSums> blocks(sums.parts.size() / kAll);
  double samples = 0.0;
  for (size_t k = 0; k < sums.parts.size(); ++k) {
    const double count = sums.parts[k].normal[0];
    if (count == 0.0) continue;
    samples += count;
    const Eigen::Map<const LightSides> right(sums.parts[k].right.data());
    const double x = right(0, 4) / count, y = right(0, 5) / count;
    add_part(blocks[k / kAll], sums.parts[k],
             lens_at(before, rig.panel, x, y) - lens_at(now, rig.panel, x, y));
  }
  // A block half covered by a tag is less reliable than its weight states.
  const double usual = samples / static_cast<double>(blocks.size());
  std::vector<FringeBlock> out;
  for (uint32_t b = 0; b < blocks.size(); ++b) {
    if (blocks[b].normal[0] <= std::max(0.3 * usual, 4.0 * LightSums::kLightTerms)) continue;
    const double detuning =
        SinglePhotoChart::detuning(static_cast<int>(b) / sums.columns * chart.bands / sums.rows);
    if (const auto block = block_of(blocks[b], b, detuning)) out.push_back(*block);
  }
  return out;
}

namespace {

constexpr int kMostColumns = 512;
constexpr int kFewestColumns = 128;
constexpr int kRows = 128;
/// Fewer fringes than this count as uneven light.
constexpr int kLeastFringes = 8;
/// Largest error of the starting pitch, relative to the number of lenses.
constexpr double kMostMoreAcross = 0.12;
constexpr int kMostMoreDown = 56;
constexpr std::array<double, 4> kKinds = {1.0, -1.0, 2.0, -2.0};  ///< detunings

/// Returns the number of grid columns for which nearly every cell gets a pixel of the photograph:
/// holes would form a pattern of their own.
int columns_for(const FringeSamples& fringes, const optics::Panel& panel) {
  const double shape = double(panel.width_px) / panel.height_px;
  const double pixels_across = std::sqrt(static_cast<double>(fringes.samples.size()) * shape);
  return std::clamp(static_cast<int>(0.9 * pixels_across), kFewestColumns, kMostColumns);
}

/// Returns the mean light of a grid of positions, relative to the local mean; 0 in cells without a
/// sample.
Eigen::MatrixXd light_grid(const FringeSamples& fringes, const SinglePhotoChart& chart,
                           double detuning, int columns) {
  const size_t blocks = static_cast<size_t>(fringes.columns) * static_cast<size_t>(fringes.rows);
  std::vector<double> light(blocks), count(blocks);
  for (const FringeSample& sample : fringes.samples) {
    light[sample.block] += sample.light;
    count[sample.block] += 1.0;
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(kRows, columns), n = sum;
  const optics::Panel& panel = chart.start.panel;
  for (const FringeSample& sample : fringes.samples) {
    if (SinglePhotoChart::detuning(fringes.band_of(sample.block, chart.bands)) != detuning)
      continue;
    const int c = std::clamp(static_cast<int>(double{sample.panel_x_px} * columns / panel.width_px),
                             0, columns - 1);
    const int r = std::clamp(static_cast<int>(double{sample.panel_y_px} * kRows / panel.height_px),
                             0, kRows - 1);
    sum(r, c) += sample.light - light[sample.block] / count[sample.block];
    n(r, c) += 1.0;
  }
  return (n.array() > 0.0).select(sum.array() / n.array().max(1.0), 0.0);
}

/// Spectrum measures the strength of the fringes of one kind of band relative to chance level.
class Spectrum {
 public:
  explicit Spectrum(const Eigen::MatrixXd& light)
      : values_(light.rows(), light.cols()), columns_(static_cast<int>(light.cols())) {
    Eigen::FFT<double> fft;
    Eigen::VectorXcd in, line;
    for (int r = 0; r < kRows; ++r) {
      in = light.row(r).cast<std::complex<double>>();
      fft.fwd(line, in);
      values_.row(r) = line.transpose();
    }
    for (int c = 0; c < columns_; ++c) {
      in = values_.col(c);
      fft.fwd(line, in);
      values_.col(c) = line;
    }
    std::vector<double> sizes;
    for (int c = kLeastFringes; c < columns_ / 2; ++c)
      for (int r = 0; r < kRows; ++r) sizes.push_back(std::abs(values_(r, c)));
    usual_ = std::max(upper_median(std::move(sizes)), 1e-30);
  }

  /// Returns the strength; 1 is chance level, also for frequencies that the grid does not resolve
  /// and for those of uneven light.
  [[nodiscard]] double strength(int across, int down) const {
    const bool resolved = 2 * std::abs(across) < columns_ && 2 * std::abs(down) < kRows;
    if (!resolved || std::abs(across) < kLeastFringes) return 1.0;
    return std::abs(values_((down + kRows) % kRows, (across + columns_) % columns_)) / usual_;
  }

 private:
  Eigen::MatrixXcd values_;
  int columns_;
  double usual_ = 1.0;
};

}  // namespace

FringeCount count_fringes(const FringeSamples& fringes, const SinglePhotoChart& chart) {
  const optics::Panel& panel = chart.start.panel;
  const int columns = columns_for(fringes, panel);
  std::vector<Spectrum> spectra;
  for (const double kind : kKinds) spectra.emplace_back(light_grid(fringes, chart, kind, columns));
  const int across = chart.fringes;
  const int down = static_cast<int>(
      std::lround(across * chart.start.sheet.slant * panel.height_px / panel.width_px));
  const int most = static_cast<int>(kMostMoreAcross * plane_of(chart.start).across);
  FringeCount best;
  for (int y = -kMostMoreDown; y <= kMostMoreDown; ++y) {
    for (int x = -most; x <= most; ++x) {
      double product = 1.0;
      for (size_t k = 0; k < kKinds.size(); ++k) {
        const int kind = static_cast<int>(kKinds[k]);
        product *= spectra[k].strength(kind * across - x, kind * down - y);
      }
      const double prominence = std::pow(product, 1.0 / static_cast<double>(kKinds.size()));
      if (prominence <= best.prominence) continue;
      best = {{double(x), double(y)}, prominence};
    }
  }
  return best;
}

}  // namespace lenticule::calib
