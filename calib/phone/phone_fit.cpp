// SPDX-License-Identifier: Apache-2.0
// A photograph gives phases of fringes, each at a pixel, and corners of tags. All unknowns are one
// vector: the blocks of camera and sheet (projection.h), the warp of the phone's pictures, the
// knots of the residual map, and one block for each photograph with its pose, its own camera, the
// enlargement of its tags, the rotation of the hand while the rows were read, and a motion of the
// sheet, which is zero unless photographs contradict each other.
//
// 1. The photographs' own fits give a start. Phases are known only up to whole lenses: of many
//    gaps, the one is taken at which a single offset explains the phases of all photographs.
// 2. Ceres minimises the squared residuals of phases, corners and priors, with Cauchy's loss at
//    three standard errors. The standard errors are those that the residuals show, so they are
//    computed from the fit, and the fit is repeated, three times.
// 3. The inverse of the normal equations is the covariance of all unknowns.
// 4. For each photograph, a fit in which the hand may have turned shows how likely that is.
// 5. The phases of red, green and blue differ from their mean, for which the fit was made: they
//    give the gap of each colour.
// 6. If photographs contradict each other, fits with one mistake in one photograph show the cause.
#include "calib/phone/phone_fit.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <iterator>
#include <numbers>
#include <type_traits>
#include <utility>

#include "base/statistics.h"
#include "base/worker_threads.h"
#include "calib/fit/projection.h"
#include "calib/linear_algebra.h"
#include "optics/eye_simulator.h"

namespace lenticule::calib {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// FringeSeen is the phase of the chart's fringes at a pixel.
struct FringeSeen {
  Vec2 pixel;
  Fringe fringe;                         ///< the chart's comb at this place
  double turns = 0.0;                    ///< comb minus lens coordinate, up to whole lenses
  double weight = 1.0;                   ///< relative to that of the usual block
  std::array<double, 3> colour_turns{};  ///< turns of red, green and blue minus `turns`
};

/// CornerSeen is one coordinate of a corner of a tag.
struct CornerSeen {
  Vec2 pixel;
  bool vertical = false;
  Vec2 panel_mm;
  Vec2 from_middle_mm;         ///< from the middle of its tag
  double pixels_per_mm = 1.0;  ///< scale of the tags of its photograph
};

/// PhoneObservations are those of one photograph. Pixels are those of the averaged picture.
struct PhoneObservations {
  std::vector<FringeSeen> phases;  ///< one phase for each of PhotoFindings::blocks, in their order
  std::vector<CornerSeen> corners;
  std::optional<PhotoMotion> motion = {};
};

constexpr int kGreen = 1;

void add_fringes(const PhotoFindings& photo, const SinglePhotoChart& chart,
                 PhoneObservations& out) {
  const optics::OpticalModel model(photo.rig);
  std::vector<double> weights;
  for (const FringeBlock& block : photo.blocks) weights.push_back(block.weight);
  const double usual = weights.empty() ? 1.0 : upper_median(weights);
  for (const FringeBlock& block : photo.blocks) {
    const auto at = photo.pose->seen_point(block.pixel, chart.start);
    if (!at) continue;
    const double lens = model.lens_coordinate(at->lens_px.x, at->lens_px.y, kGreen);
    const double comb = chart.comb_phase(at->panel_px.x, at->panel_px.y, block.detuning);
    const double per_subpx = 1.0 / chart.centre_pitch_subpx +
                             block.detuning * chart.fringes / (3.0 * chart.start.panel.width_px);
    out.phases.push_back({block.pixel,
                          {.pitch_subpx = 1.0 / per_subpx, .slant = chart.start.sheet.slant},
                          comb - lens + block.phase,
                          std::min(block.weight / usual, 2.0),
                          block.colour_phase});
  }
}

void add_corners(const PhotoFindings& photo, const SinglePhotoChart& chart,
                 PhoneObservations& out) {
  const optics::Panel& panel = chart.start.panel;
  double length = 0.0, picture = 0.0;
  for (const TagSighting& tag : photo.tags) {
    const auto drawn = chart.tag(tag.id)->corners_px();
    const Vec2 middle = (drawn[0] + drawn[2]) * 0.5;
    for (size_t k = 0; k < drawn.size(); ++k) {
      const Vec2 mm{panel.x_mm(drawn[k].x), panel.y_mm(drawn[k].y)};
      for (const bool vertical : {false, true})
        out.corners.push_back({tag.corners_px[k], vertical, mm,
                               mm - Vec2{panel.x_mm(middle.x), panel.y_mm(middle.y)}});
    }
    length += std::hypot(panel.x_mm(drawn[2].x) - panel.x_mm(drawn[0].x),
                         panel.y_mm(drawn[2].y) - panel.y_mm(drawn[0].y));
    picture += std::hypot(tag.corners_px[2].x - tag.corners_px[0].x,
                          tag.corners_px[2].y - tag.corners_px[0].y);
  }
  for (CornerSeen& corner : out.corners) corner.pixels_per_mm = picture / length;
}

/// Converts the findings of a photograph that was measured without refusal.
PhoneObservations phone_observations(const PhotoFindings& photo, const SinglePhotoChart& chart) {
  PhoneObservations out;
  add_fringes(photo, chart, out);
  add_corners(photo, chart, out);
  return out;
}

/// The warp of a phone is the smooth displacement that the correction of its lens leaves in each
/// picture; tangential distortion is a part of it. It is a sum of products of Chebyshev polynomials
/// of the place, separately along rows and columns, of degrees 1 to kWarpDegree together. Of the
/// linear terms only two are not a turn or another focal length: both are along rows.
constexpr int kWarpDegree = 5;
constexpr int kWarpTerms = (kWarpDegree + 1) * (kWarpDegree + 2) / 2 - 3;
constexpr int kWarpCount = 2 * kWarpTerms + 2;

/// Calls `use(coefficient, vertical, degree, value)` for the terms at a place, which is in halves
/// of the picture's longer side from its middle.
template <class Use>
void for_warp_terms(Vec2 place, const Use& use) {
  double across[kWarpDegree + 1] = {1.0, place.x}, down[kWarpDegree + 1] = {1.0, place.y};
  for (int k = 2; k <= kWarpDegree; ++k) {
    across[k] = 2.0 * place.x * across[k - 1] - across[k - 2];
    down[k] = 2.0 * place.y * down[k - 1] - down[k - 2];
  }
  use(0, false, 1, place.x);
  use(1, false, 1, place.y);
  int at = 2;
  for (int degree = 2; degree <= kWarpDegree; ++degree)
    for (int k = 0; k <= degree; ++k)
      for (const bool vertical : {false, true})
        use(at++, vertical, degree, across[degree - k] * down[k]);
}

/// PhoneModel holds the observations of all photographs, and computes their residuals from the
/// unknowns in any number type, for automatic differentiation.
///
/// Lifetime: must not outlive the chart. Thread safety: any thread.
class PhoneModel {
 public:
  /// Indices in the block of a photograph: the pose, its own camera, the enlargement of its tags,
  /// the rotation from the first row read to the last, and how far the sheet had moved, lenses.
  static constexpr int kOwn = kPoseCount, kBreathing = kOwn + kOwnFocal,
                       kShiftX = kOwn + kOwnCentreX, kShiftY = kOwn + kOwnCentreY,
                       kLarger = kOwn + kOwnCount, kTurn = kLarger + 1, kMoved = kTurn + 3,
                       kPhotoCount = kMoved + 1;
  /// Indices of blocks in the vector of all unknowns.
  static constexpr int kSheet = kCameraCount, kWarp = kSheet + kSheetCount,
                       kKnots = kWarp + kWarpCount;

  PhoneModel(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart)
      : panel_(chart.start.panel),
        longer_(std::max(photos[0].width, photos[0].height)),
        height_(photos[0].height),
        middle_{0.5 * photos[0].width, 0.5 * photos[0].height} {
    for (const PhotoFindings& photo : photos) {
      seen_.push_back(phone_observations(photo, chart));
      seen_.back().motion = photo.motion;
      is_film_ = is_film_ || photo.motion;
    }
  }

  /// Returns the observations of each photograph.
  [[nodiscard]] const std::vector<PhoneObservations>& seen() const { return seen_; }
  [[nodiscard]] const KnotGrid& grid() const { return grid_; }
  [[nodiscard]] double longer_px() const { return longer_; }  ///< side of the pictures

  /// Returns true if photographs are frames of a film, which have the readout time as an unknown.
  [[nodiscard]] bool is_film() const { return is_film_; }

  [[nodiscard]] Index size() const { return readout_at() + (is_film_ ? 1 : 0); }
  /// Returns the index of the readout time of a film, seconds.
  [[nodiscard]] Index readout_at() const { return photo_at(seen_.size()); }
  /// Returns the index of the block of photograph n.
  [[nodiscard]] Index photo_at(size_t n) const {
    return kKnots + grid_.count() + kPhotoCount * static_cast<Index>(n);
  }

  /// Returns where a pixel of the picture would be without the warp.
  [[nodiscard]] PlanePoint<double> without_warp(const double* warp, Vec2 pixel) const {
    PlanePoint<double> at{pixel.x, pixel.y};
    for_warp_terms(place_of(pixel), [&](int k, bool vertical, int, double value) {
      (vertical ? at.y : at.x) -= longer_ * warp[k] * value;
    });
    return at;
  }
  /// Returns the place of a pixel for for_warp_terms().
  [[nodiscard]] Vec2 place_of(Vec2 pixel) const { return (pixel - middle_) * (2.0 / longer_); }

  /// Returns the difference of a phase from what the blocks of unknowns predict without the
  /// residual map, in turns, and the point of the lens-apex plane at which it is seen.
  template <class T>
  T rest(const T* camera, const T* sheet, const T* photo, const FringeSeen& seen,
         const PlanePoint<T>& pixel, PlanePoint<T>& lens) const {
    lens = seen_point(camera, photo, pixel);
    return seen.turns -
           fringe_turns(seen.fringe, panel_, fringe_point(photo, sheet, panel_, lens)) +
           lens_coordinate(sheet, panel_, lens) + photo[kMoved];
  }
  /// Returns the difference of a corner from its place on the panel, in pixels of the picture.
  template <class T>
  T rest(const T* camera, const T* sheet, const T* photo, const CornerSeen& seen,
         const PlanePoint<T>& pixel, PlanePoint<T>& lens) const {
    lens = seen_point(camera, photo, pixel);
    const PlanePoint<T> at = wide_pattern_point(photo, sheet, panel_, lens);
    const T larger = 1.0 + photo[kLarger];
    const Vec2 middle = seen.panel_mm - seen.from_middle_mm;
    return (seen.vertical ? at.y - middle.y - larger * seen.from_middle_mm.y
                          : at.x - middle.x - larger * seen.from_middle_mm.x) *
           seen.pixels_per_mm;
  }

  /// Moves the block of photograph n to the moment at which the row of a pixel was read.
  template <class T>
  void add_motion(size_t n, Vec2 pixel, const T& readout_s, T* photo) const {
    const auto& [mm_s, radians_s] = *seen_[n].motion;
    const T seconds = readout_s * (pixel.y / height_ - 0.5);
    for (int k = 0; k < 3; ++k) {
      const auto component = [k](const Vec3& v) { return k == 0 ? v.x : k == 1 ? v.y : v.z; };
      photo[kPupil + k] += seconds * component(mm_s);
      photo[kTurn + k] += readout_s * component(radians_s);
    }
  }

  /// Returns the weights of the knots at a point of the panel.
  [[nodiscard]] std::vector<KnotWeight> weights_at(double x_mm, double y_mm) const {
    return knot_weights(grid_, {panel_.x_px(x_mm), panel_.y_px(y_mm)}, panel_.width_px,
                        panel_.height_px);
  }

  /// Returns the residual of an observation of photograph n, of a phase without whole lenses.
  template <class Seen>
  [[nodiscard]] double rest(const VectorXd& values, size_t n, const Seen& seen) const {
    const double* all = values.data();
    std::array<double, kPhotoCount> photo;
    std::copy_n(all + photo_at(n), kPhotoCount, photo.begin());
    if (seen_[n].motion) add_motion(n, seen.pixel, values[readout_at()], photo.data());
    return rest(all, all + kSheet, photo.data(), all + kWarp, all + kKnots, seen);
  }
  template <class Seen>
  [[nodiscard]] double rest(const double* camera, const double* sheet, const double* photo,
                            const double* warp, const double* knots, const Seen& seen) const {
    PlanePoint<double> lens{};
    double off = rest(camera, sheet, photo, seen, without_warp(warp, seen.pixel), lens);
    if constexpr (std::is_same_v<Seen, CornerSeen>) return off;
    for (const KnotWeight& w : weights_at(lens.x, lens.y)) off += w.weight * knots[w.knot];
    return off - std::round(off);
  }
  template <class Seen>
  [[nodiscard]] std::vector<double> rests(const VectorXd& values, size_t n,
                                          const std::vector<Seen>& all) const {
    std::vector<double> out;
    for (const Seen& seen : all) out.push_back(rest(values, n, seen));
    return out;
  }

 private:
  /// Returns the point of the lens-apex plane that a pixel sees. The rows are read one after the
  /// other while the hand turns the camera; `row` is -1/2 for the first and 1/2 for the last.
  template <class T>
  PlanePoint<T> seen_point(const T* common, const T* photo, const PlanePoint<T>& pixel) const {
    T camera[kCameraCount];
    camera_of_view(common, photo + kOwn, longer_, camera);
    const PlanePoint<T> d = undistorted(camera, pixel.x, pixel.y);
    const T row = pixel.y / height_ - 0.5;
    const T* turn = photo + kTurn;
    const T in_camera[3] = {d.x + row * (turn[1] - turn[2] * d.y),
                            d.y + row * (turn[2] * d.x - turn[0]),
                            1.0 + row * (turn[0] * d.y - turn[1] * d.x)};
    return lens_plane_along(photo, in_camera);
  }

  const optics::Panel& panel_;
  double longer_, height_;
  Vec2 middle_;
  bool is_film_ = false;
  KnotGrid grid_{.columns = 13, .rows = 8};
  std::vector<PhoneObservations> seen_;
};

constexpr double kGapSigma = 0.15;  ///< relative standard deviation of the gap's prior
/// Prior of the time in which a phone reads the rows of a frame.
constexpr double kUsualReadoutS = 0.018, kReadoutSigmaS = 0.006;

/// Returns the pose block of a pose whose camera looks along -z with y up.
PoseValues pose_values(const PhotoPose& pose) {
  PoseValues out{};
  const auto& m = pose.panel_from_camera;
  // Row-major camera_from_panel: transposed, with y and z turned round.
  const std::array<double, 9> turned = {m[0], m[3], m[6], -m[1], -m[4], -m[7], -m[2], -m[5], -m[8]};
  ceres::RotationMatrixToAngleAxis(ceres::RowMajorAdapter3x3(turned.data()), out.data());
  out[kPupil] = pose.eye_mm.x;
  out[kPupil + 1] = pose.eye_mm.y;
  out[kPupil + 2] = pose.eye_mm.z;
  return out;
}

/// Writes the gap and the offset that fit best into the values.
void search_gap(const PhoneModel& model, VectorXd& values) {
  constexpr int kSteps = 60;
  const std::vector<PhoneObservations>& photos = model.seen();
  double* sheet = values.data() + PhoneModel::kSheet;
  const double start = sheet[kGap];
  double best = -1.0, best_gap = start, best_offset = 0.0;
  sheet[kOffset] = 0.0;
  for (int k = -kSteps; k <= kSteps; ++k) {
    sheet[kGap] = start * (1.0 + 0.3 * k / kSteps);
    std::complex<double> sum;
    for (size_t n = 0; n < photos.size(); ++n) {
      std::complex<double> own;
      for (const FringeSeen& seen : photos[n].phases)
        own += std::polar(1.0, 2.0 * std::numbers::pi * model.rest(values, n, seen));
      sum += own / static_cast<double>(std::max<size_t>(photos[n].phases.size(), 1));
    }
    const double off = 0.3 * k / kSteps / kGapSigma;
    const double score = std::abs(sum) / static_cast<double>(photos.size()) - 0.02 * off * off;
    if (score <= best) continue;
    best = score;
    best_gap = sheet[kGap];
    // rest = turns - (comb - lens) with offset 0: the offset is minus its mean.
    best_offset = -std::arg(sum) / (2.0 * std::numbers::pi);
  }
  sheet[kGap] = best_gap;
  sheet[kOffset] = best_offset;
}

/// Returns all unknowns at the start, without the gap and the offset.
VectorXd start_values(const PhoneModel& model, const std::vector<PhotoFindings>& photos,
                      const optics::Rig& rig) {
  VectorXd values = VectorXd::Zero(model.size());
  const SheetParameters sheet = sheet_start(rig).values;
  std::copy(sheet.begin(), sheet.end(), values.data() + PhoneModel::kSheet);
  values[kCentreX] = 0.5 * photos[0].width;
  values[kCentreY] = 0.5 * photos[0].height;
  double across = 0.0, down = 0.0;
  const double share = 1.0 / static_cast<double>(photos.size());
  for (const PhotoFindings& photo : photos) {
    values[kFocal] += share * photo.pose->focal_px;
    values[kRadial1] -= share * photo.pose->distortion;
    const LensPlane plane = plane_of(photo.rig);
    across += 0.5 * share * plane.across;
    down += 0.5 * share * plane.down;
  }
  values[PhoneModel::kSheet + kAcross] = across;
  values[PhoneModel::kSheet + kDown] = down;
  for (size_t n = 0; n < photos.size(); ++n) {
    const PhotoPose& pose = *photos[n].pose;
    double* const own = values.data() + model.photo_at(n);
    const PoseValues block = pose_values(pose);
    std::copy(block.begin(), block.end(), own);
    // The photographs' own poses have one focal length and principal point each.
    own[PhoneModel::kBreathing] = pose.focal_px / values[kFocal] - 1.0;
    own[PhoneModel::kShiftX] = (pose.middle_px.x - values[kCentreX]) / model.longer_px();
    own[PhoneModel::kShiftY] = (pose.middle_px.y - values[kCentreY]) / model.longer_px();
    own[PhoneModel::kLarger] = pose.tags_larger;
  }
  if (model.is_film()) values[model.readout_at()] = kUsualReadoutS;
  return values;
}

/// Term is the residual of an observation in standard errors. Parameter blocks: camera, sheet,
/// photograph, warp; for a phase also all knots, of which a point of the panel needs at most 16;
/// in a film also the readout time.
template <class Seen>
class Term final : public ceres::CostFunction {
 public:
  Term(const PhoneModel& model, size_t photo, const Seen& seen, double sigma)
      : model_(model), photo_(photo), seen_(seen), sigma_(sigma) {
    set_num_residuals(1);
    *mutable_parameter_block_sizes() = {kSizes[0], kSizes[1], kSizes[2], kWarpCount};
    if constexpr (kHasKnots) mutable_parameter_block_sizes()->push_back(model.grid().count());
    if (model.is_film()) mutable_parameter_block_sizes()->push_back(1);
  }

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const double* const warp = blocks[kBlocks];
    const double* const knots = kHasKnots ? blocks[kBlocks + 1] : nullptr;
    std::array<double, PhoneModel::kPhotoCount> photo;
    std::copy_n(blocks[2], photo.size(), photo.begin());
    const bool moves = model_.seen()[photo_].motion.has_value();
    if (moves) model_.add_motion(photo_, seen_.pixel, blocks[kReadout][0], photo.data());
    residual[0] = model_.rest(blocks[0], blocks[1], photo.data(), warp, knots, seen_) / sigma_;
    if (jacobians == nullptr) return std::isfinite(residual[0]);
    std::array<Jet, kUnknowns> unknowns;
    for (int b = 0, at = 0; b < kBlocks; ++b)
      for (int k = 0; k < kSizes[b]; ++k, ++at)
        unknowns[static_cast<size_t>(at)] = Jet(blocks[b][k], at);
    if (moves)
      model_.add_motion(photo_, seen_.pixel, Jet(blocks[kReadout][0], kUnknowns + 2),
                        unknowns.data() + kSizes[0] + kSizes[1]);
    const PlanePoint<double> at_pixel = model_.without_warp(warp, seen_.pixel);
    const PlanePoint<Jet> pixel{Jet(at_pixel.x, kUnknowns), Jet(at_pixel.y, kUnknowns + 1)};
    const Jet* const sheet = unknowns.data() + kSizes[0];
    PlanePoint<Jet> lens;
    const Jet off = model_.rest(unknowns.data(), sheet, sheet + kSizes[1], seen_, pixel, lens);
    for (int b = 0, at = 0; b < kBlocks; at += kSizes[b++])
      for (int k = 0; k < kSizes[b] && jacobians[b] != nullptr; ++k)
        jacobians[b][k] = off.v[at + k] / sigma_;
    if (double* const slopes = jacobians[kBlocks]; slopes != nullptr)
      for_warp_terms(model_.place_of(seen_.pixel), [&](int k, bool vertical, int, double value) {
        slopes[k] = -model_.longer_px() * value * off.v[kUnknowns + (vertical ? 1 : 0)] / sigma_;
      });
    if (double* const slopes = kHasKnots ? jacobians[kBlocks + 1] : nullptr; slopes != nullptr) {
      std::fill_n(slopes, model_.grid().count(), 0.0);
      for (const KnotWeight& w : model_.weights_at(lens.x.a, lens.y.a))
        slopes[w.knot] = w.weight / sigma_;
    }
    if (model_.is_film() && jacobians[kReadout] != nullptr)
      jacobians[kReadout][0] = off.v[kUnknowns + 2] / sigma_;
    return std::isfinite(residual[0]);
  }

 private:
  static constexpr bool kHasKnots = std::is_same_v<Seen, FringeSeen>;
  static constexpr int kBlocks = 3;  ///< with derivatives by dual numbers
  static constexpr int kSizes[kBlocks] = {kCameraCount, kSheetCount, PhoneModel::kPhotoCount};
  static constexpr int kUnknowns = kSizes[0] + kSizes[1] + kSizes[2];
  static constexpr int kReadout = kBlocks + (kHasKnots ? 2 : 1);  ///< block of a film
  /// Derivatives also by the pixel, which the warp moves, and by the readout time.
  using Jet = ceres::Jet<double, kUnknowns + 3>;

  const PhoneModel& model_;
  size_t photo_;
  const Seen& seen_;
  double sigma_;
};

// Standard deviations of priors. Principal points of phones are within 0.8 % of the longer side.
constexpr double kAxisSigma = 0.006;
constexpr double kRadialSigma = 0.1, kLargerSigma = 0.1, kShapeSigma = 0.1;
constexpr double kAberrationSigma = 0.02, kSagSigma = 0.05;
constexpr double kBendSigma = 0.01;  ///< second differences of the map, lenses
/// Warp by the degree of its terms, parts of the longer side; 2 has most of tangential distortion.
constexpr double kWarpSigmas[kWarpDegree + 1] = {0.0, 2e-4, 2e-4, 1.5e-4, 1e-4, 5e-5};
constexpr double kKnotSigma = 0.1;  ///< lenses; keeps plane and map apart

/// Returns the weights of the map's prior: knots are small, and their second differences smaller.
MatrixXd map_weights(const KnotGrid& grid) {
  std::vector<VectorXd> rows;
  const auto add = [&](int first, int step, std::initializer_list<double> weights, double sigma) {
    rows.emplace_back(VectorXd::Zero(grid.count()));
    for (const double weight : weights) {
      rows.back()[first] = weight / sigma;
      first += step;
    }
  };
  for (int r = 0; r < grid.rows; ++r)
    for (int c = 0; c < grid.columns; ++c) {
      const int knot = r * grid.columns + c;
      if (c + 2 < grid.columns) add(knot, 1, {1.0, -2.0, 1.0}, kBendSigma);
      if (r + 2 < grid.rows) add(knot, grid.columns, {1.0, -2.0, 1.0}, kBendSigma);
      add(knot, 0, {1.0}, kKnotSigma);
    }
  MatrixXd out(static_cast<Index>(rows.size()), grid.count());
  for (size_t k = 0; k < rows.size(); ++k) out.row(static_cast<Index>(k)) = rows[k].transpose();
  return out;
}

/// Returns the derivative of a phase by the gap, lenses per mm.
double phase_per_gap(const PhoneModel& model, const VectorXd& values, size_t n,
                     const FringeSeen& seen) {
  constexpr double kPart = 1e-3;
  VectorXd more = values;
  more[PhoneModel::kSheet + kGap] *= 1.0 + kPart;
  return (model.rest(values, n, seen) - model.rest(more, n, seen)) /
         (kPart * values[PhoneModel::kSheet + kGap]);
}

/// Measures the gap of red, green and blue light, mm, at the fitted values, in the order of
/// PhoneModel. Phases move by the gap's change times their slope over it, so the colours'
/// differences from the mean of the channels show the differences of their gaps. `gap_sigma` is the
/// standard error of the fitted gap.
std::array<Estimate, 3> colour_gaps(const PhoneModel& model, const VectorXd& values,
                                    double gap_sigma) {
  const std::vector<PhoneObservations>& photos = model.seen();
  const double gap = values[PhoneModel::kSheet + kGap];
  std::array<Estimate, 3> gaps;
  for (size_t c = 0; c < gaps.size(); ++c) {
    double product = 0.0, square = 0.0, rest = 0.0, count = 0.0;
    const auto for_each = [&](const auto& use) {
      for (size_t n = 0; n < photos.size(); ++n)
        for (const FringeSeen& seen : photos[n].phases)
          use(seen.weight, seen.colour_turns[c], phase_per_gap(model, values, n, seen));
    };
    for_each([&](double weight, double ahead, double slope) {
      product += weight * ahead * slope;
      square += weight * slope * slope;
    });
    const double more = square > 0.0 ? product / square : 0.0;
    for_each([&](double weight, double ahead, double slope) {
      rest += weight * std::pow(ahead - more * slope, 2);
      count += 1.0;
    });
    const double own = square > 0.0 ? std::sqrt(rest / count / square) : 0.0;
    gaps[c] = {gap + more, std::hypot(gap_sigma, own)};
  }
  return gaps;
}

/// MistakePrior holds the unknowns of a photograph that a mistake changes, and their standard
/// deviations: the usual one, and the one of a photograph with the mistake.
struct MistakePrior {
  int at, count;
  double usual, of_mistake;
};
/// Rotation while the rows are read (1 degree a second for 17 ms, 10 degrees), shift of the axis,
/// breathing, motion of the sheet; in the order of MistakeKind.
constexpr MistakePrior kMistakes[] = {{PhoneModel::kTurn, 3, 3e-4, 3e-3},
                                      {PhoneModel::kShiftX, 2, kOwnCentreSigma, 0.02},
                                      {PhoneModel::kBreathing, 1, kOwnFocalSigma, 0.1},
                                      {PhoneModel::kMoved, 1, 1e-4, 0.3}};
constexpr double kMovedTurnSigma = kMistakes[0].of_mistake;

/// Smallest standard errors: errors of neighbouring blocks and corners are alike. Up to kFewPhotos
/// photographs determine axes and rotations so badly that all that fringes and tags say is needed;
/// more photographs show where the law of rigs does not hold.
constexpr double kLeastPhaseSigma = 0.002, kLeastPhaseSigmaOfFew = 0.001;
constexpr double kLeastCornerPx = 0.08, kLeastCornerPxOfFew = 0.03;

class Joint {
 public:
  Joint(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart,
        const Estimate& focal)
      : model_(photos, chart),
        values_(start_values(model_, photos, chart.start)),
        means_(values_),
        focal_sigma_(focal.sigma),
        phase_sigma_(photos.size(), 0.01),
        corner_sigma_(photos.size(), 0.5) {
    means_[kFocal] = focal.value;
    means_[kRadial1] = 0.0;
    search_gap(model_, values_);
  }

  std::optional<PhoneFit> run(const PlausibleFit& plausible) {
    const std::optional<MatrixXd> inverse = settle(plausible);
    if (!inverse) return std::nullopt;
    PhoneFit fit = finish(*inverse);
    if (plausible && !plausible(fit)) return fit;
    std::vector<std::optional<TurnedFit>> turned(model_.seen().size());
    WorkerThreads(0).run(static_cast<int>(turned.size()), [this, &turned](int n, int /*worker*/) {
      Joint own = *this;
      turned[static_cast<size_t>(n)] = own.turned_fit(static_cast<size_t>(n));
    });
    for (auto& found : turned)
      if (found) fit.turned.push_back(std::move(*found));
    return fit;
  }

  /// Returns the explanations of a contradiction, the likeliest first.
  std::vector<Explanation> explain(std::optional<size_t> only) {
    double cost = 0.0, spread = 0.0;
    if (!only) {
      const std::optional<MatrixXd> inverse = settle(nullptr);
      if (!inverse) return {};
      cost = cost_;
      spread = log_determinant(*inverse);
    }
    constexpr size_t kKinds = std::size(kMistakes);
    std::vector<std::optional<Explanation>> all(kKinds * (only ? 1 : model_.seen().size()));
    WorkerThreads(0).run(static_cast<int>(all.size()), [&, this](int job, int /*worker*/) {
      Joint own = *this;
      const auto n = static_cast<size_t>(job);
      all[n] = own.explanation(only.value_or(0) + n / kKinds, n % kKinds, cost, spread);
    });
    std::vector<Explanation> out;
    for (const auto& found : all)
      if (found) out.push_back(*found);
    std::ranges::sort(out, std::greater{}, &Explanation::evidence);
    return out;
  }

 private:
  /// Finds the unknowns with the standard errors that the residuals show, unless a fit on the way
  /// is not plausible.
  std::optional<MatrixXd> settle(const PlausibleFit& plausible) {
    std::optional<MatrixXd> inverse = solve();
    for (int round = 0; inverse && round < 3; ++round) {
      if (plausible && !plausible(finish(*inverse))) break;
      rescale();
      inverse = solve();
    }
    return inverse;
  }
  /// Fits with one mistake in one photograph. Evidence is relative to a fit without it.
  std::optional<Explanation> explanation(size_t n, size_t k, double cost, double spread) {
    const auto kind = static_cast<MistakeKind>(k);
    const std::optional<MatrixXd> inverse = solve(Mistake{kind, n});
    if (!inverse) return std::nullopt;
    const auto& [at, count, usual, of_mistake] = kMistakes[k];
    return Explanation{kind, n, values_.segment(model_.photo_at(n) + at, count).norm(),
                       cost - cost_ + 0.5 * (log_determinant(*inverse) - spread) -
                           count * std::log(of_mistake / usual)};
  }
  static double log_determinant(const MatrixXd& covariance) {
    return covariance.ldlt().vectorD().array().abs().max(1e-300).log().sum();
  }
  double* block_of(size_t n) { return values_.data() + model_.photo_at(n); }

  /// Mistake is what one photograph may have that the others do not.
  struct Mistake {
    MistakeKind kind;
    size_t photo;
  };

  /// Finds the unknowns, and returns their covariance; nothing if they do not settle.
  std::optional<MatrixXd> solve(std::optional<Mistake> mistake = std::nullopt) {
    ceres::Problem problem;
    add_priors_of_camera_and_sheet(problem);
    for (size_t n = 0; n < model_.seen().size(); ++n)
      add_photo(problem, n,
                mistake && mistake->photo == n ? std::optional(mistake->kind) : std::nullopt);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 40;
    options.initial_trust_region_radius = 1e6;
    options.function_tolerance = 1e-6;
    options.parameter_tolerance = 1e-12;
    options.num_threads = 1;  // the order of sums does not depend on the machine's load
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return std::nullopt;
    cost_ = summary.final_cost;
    std::vector<double*> blocks;
    for (const int at : {0, PhoneModel::kSheet, PhoneModel::kWarp, PhoneModel::kKnots})
      blocks.push_back(values_.data() + at);
    for (size_t n = 0; n < model_.seen().size(); ++n) blocks.push_back(block_of(n));
    if (model_.is_film()) blocks.push_back(values_.data() + model_.readout_at());
    return inverse_of_normal_equations(problem, blocks);
  }

  void add_priors_of_camera_and_sheet(ceres::Problem& problem) {
    const double axis_sigma = kAxisSigma * model_.longer_px();
    const auto prior = [this](int block, int at, double sigma) {
      return Prior{at, means_[block + at], sigma};
    };
    constexpr int kSheet = PhoneModel::kSheet;
    add_priors(problem, values_.data(), kCameraCount,
               {prior(0, kFocal, focal_sigma_), prior(0, kCentreX, axis_sigma),
                prior(0, kCentreY, axis_sigma), prior(0, kRadial1, kRadialSigma),
                prior(0, kRadial2, kRadialSigma)});
    add_priors(
        problem, values_.data() + kSheet, kSheetCount,
        {prior(kSheet, kGap, kGapSigma * means_[kSheet + kGap]), prior(kSheet, kShape, kShapeSigma),
         prior(kSheet, kAberration, kAberrationSigma), prior(kSheet, kSag, kSagSigma)});
    std::vector<Prior> small;
    for_warp_terms({}, [&](int k, bool, int degree, double) {
      small.push_back({k, 0.0, kWarpSigmas[degree]});
    });
    add_priors(problem, values_.data() + PhoneModel::kWarp, kWarpCount, small);
    if (model_.is_film())
      add_priors(problem, values_.data() + model_.readout_at(), 1,
                 {{0, kUsualReadoutS, kReadoutSigmaS}});
    problem.AddResidualBlock(
        new ceres::NormalPrior(map_weights(model_.grid()), VectorXd::Zero(model_.grid().count())),
        nullptr, values_.data() + PhoneModel::kKnots);
  }

  void add_photo(ceres::Problem& problem, size_t n, std::optional<MistakeKind> mistake) {
    constexpr double kOutlier = 3.0, kShiftTail = 2.0;
    const PhoneObservations& photo = model_.seen()[n];
    double* const camera = values_.data();
    double* const sheet = camera + PhoneModel::kSheet;
    double* const warp = camera + PhoneModel::kWarp;
    double* const own = block_of(n);
    std::vector<double*> blocks = {camera, sheet, own, warp};
    double* const readout = values_.data() + model_.readout_at();
    const auto with_readout = [this, readout](std::vector<double*> all) {
      if (model_.is_film()) all.push_back(readout);
      return all;
    };
    for (const CornerSeen& seen : photo.corners)
      problem.AddResidualBlock(new Term(model_, n, seen, corner_sigma_[n]),
                               new ceres::CauchyLoss(kOutlier), with_readout(blocks));
    blocks.push_back(values_.data() + PhoneModel::kKnots);
    for (const FringeSeen& seen : photo.phases)
      problem.AddResidualBlock(
          new Term(model_, n, seen, phase_sigma_[n] / std::sqrt(std::max(seen.weight, 1e-3))),
          new ceres::CauchyLoss(kOutlier), with_readout(blocks));
    const auto sigma = [&](MistakeKind kind) {
      const MistakePrior& both = kMistakes[static_cast<size_t>(kind)];
      return mistake == kind ? both.of_mistake : both.usual;
    };
    const double turn = sigma(MistakeKind::Turn);
    add_priors(problem, own, PhoneModel::kPhotoCount,
               {{PhoneModel::kBreathing, 0.0, sigma(MistakeKind::Focal)},
                {PhoneModel::kLarger, 0.0, kLargerSigma},
                {PhoneModel::kTurn, 0.0, turn},
                {PhoneModel::kTurn + 1, 0.0, turn},
                {PhoneModel::kTurn + 2, 0.0, turn},
                {PhoneModel::kMoved, 0.0, sigma(MistakeKind::Sheet)}});
    // Most stabilisers shift a little, some by much.
    MatrixXd shift = MatrixXd::Zero(2, PhoneModel::kPhotoCount);
    shift(0, PhoneModel::kShiftX) = shift(1, PhoneModel::kShiftY) = 1.0 / sigma(MistakeKind::Axis);
    problem.AddResidualBlock(new ceres::NormalPrior(shift, VectorXd::Zero(PhoneModel::kPhotoCount)),
                             new ceres::CauchyLoss(kShiftTail), own);
  }

  void rescale() {
    constexpr double kOfMedian = 1.4826;  // normal distribution
    const bool few = model_.seen().size() <= kFewPhotos;
    const double least_phase = few ? kLeastPhaseSigmaOfFew : kLeastPhaseSigma;
    const double least_corner = few ? kLeastCornerPxOfFew : kLeastCornerPx;
    for (size_t n = 0; n < model_.seen().size(); ++n) {
      phase_sigma_[n] =
          std::max(least_phase,
                   kOfMedian * median_magnitude(model_.rests(values_, n, model_.seen()[n].phases)));
      corner_sigma_[n] = std::max(
          least_corner,
          kOfMedian * median_magnitude(model_.rests(values_, n, model_.seen()[n].corners)));
    }
  }

  template <class WeightOf>
  static double rms(const std::vector<double>& values, const WeightOf& weight_of) {
    double sum = 0.0, weights = 0.0;
    for (size_t k = 0; k < values.size(); ++k) {
      sum += weight_of(k) * values[k] * values[k];
      weights += weight_of(k);
    }
    return weights > 0.0 ? std::sqrt(sum / weights) : 0.0;
  }

  /// Fits once more with a free rotation during photograph n, which shows a hand that moved: the
  /// usual fit spreads such an error over poses, axes and sheet. The Bayes factor is that of no
  /// rotation against a prior of kMovedTurnSigma, by Savage and Dickey: the density of a Gaussian
  /// posterior at no rotation, over that of the prior.
  std::optional<TurnedFit> turned_fit(size_t n) {
    const std::optional<MatrixXd> inverse = solve(Mistake{MistakeKind::Turn, n});
    if (!inverse) return std::nullopt;
    const Index at = model_.photo_at(n) + PhoneModel::kTurn;
    const Eigen::Vector3d turn = values_.segment(at, 3);
    const Eigen::Matrix3d spread = inverse->block(at, at, 3, 3);
    const double pull_squared = turn.dot(solve_symmetric(spread, turn).col(0));
    const double volume = spread.determinant() / std::pow(kMovedTurnSigma, 6);
    return TurnedFit{n, turn.norm(), 0.5 * (pull_squared + std::log(volume)), finish(*inverse)};
  }

  PhotoFit photo_fit(size_t n, const MatrixXd& covariance) const {
    const double* own = values_.data() + model_.photo_at(n);
    PhotoFit out;
    out.breathing = own[PhoneModel::kBreathing];
    out.shift = {own[PhoneModel::kShiftX], own[PhoneModel::kShiftY]};
    out.breathing_pull = std::abs(out.breathing) / kOwnFocalSigma;
    out.shift_pull = std::hypot(out.shift.x, out.shift.y) / kOwnCentreSigma;
    out.phase_rests = model_.rests(values_, n, model_.seen()[n].phases);
    // Blocks that are seen steeply have little contrast.
    const std::vector<FringeSeen>& phases = model_.seen()[n].phases;
    out.phase_rms = rms(out.phase_rests, [&](size_t k) { return phases[k].weight; });
    out.corner_rms_px =
        rms(model_.rests(values_, n, model_.seen()[n].corners), [](size_t) { return 1.0; });
    const Index at = model_.photo_at(n) + kPupil;
    out.eye_sigma_mm = {std::sqrt(covariance(at, at)), std::sqrt(covariance(at + 1, at + 1)),
                        std::sqrt(covariance(at + 2, at + 2))};
    return out;
  }

  /// Returns the present fit; `inverse` is that of the normal equations.
  PhoneFit finish(const MatrixXd& inverse) const {
    PhoneFit fit;
    fit.grid = model_.grid();
    const double* values = values_.data();
    std::copy_n(values, kCameraCount, fit.values.camera.begin());
    std::copy_n(values + kCameraCount, kSheetCount, fit.values.sheet.begin());
    fit.values.knots.assign(values + PhoneModel::kKnots, values + model_.photo_at(0));
    const Index count = kSheetCount + model_.grid().count();
    std::vector<Index> kept(static_cast<size_t>(count));  // sheet and knots
    for (Index k = 0; k < count; ++k)
      kept[static_cast<size_t>(k)] = kCameraCount + k + (k < kSheetCount ? 0 : kWarpCount);
    fit.covariance = inverse(kept, kept);
    fit.colour_gap = colour_gaps(model_, values_, std::sqrt(fit.covariance(kGap, kGap)));
    fit.values.sheet[kGap] = fit.colour_gap[kGreen].value;
    for (size_t n = 0; n < model_.seen().size(); ++n) {
      PoseValues pose{};
      std::copy_n(values + model_.photo_at(n), kPoseCount, pose.begin());
      fit.values.poses.push_back(pose);
      fit.photos.push_back(photo_fit(n, inverse));
    }
    return fit;
  }

  PhoneModel model_;
  VectorXd values_;
  VectorXd means_;  ///< means of the priors of camera and sheet
  double focal_sigma_;
  double cost_ = 0.0;  ///< cost of the last solution
  std::vector<double> phase_sigma_, corner_sigma_;
};

}  // namespace

std::optional<PhoneFit> fit_phone(const std::vector<PhotoFindings>& photos,
                                  const SinglePhotoChart& chart, const Estimate& focal_px,
                                  const PlausibleFit& plausible) {
  if (photos.size() < 2) return std::nullopt;
  return Joint(photos, chart, focal_px).run(plausible);
}

std::vector<Explanation> explain_contradiction(const std::vector<PhotoFindings>& photos,
                                               const SinglePhotoChart& chart,
                                               const Estimate& focal_px,
                                               std::optional<size_t> only) {
  return Joint(photos, chart, focal_px).explain(only);
}

namespace {

/// Largest evidence of a rotation with which a result is accepted. The limit is higher for more
/// than kFewPhotos photographs: they determine rotations more exactly than the model of a rig is
/// valid.
constexpr double kMostEvidence = 11.5, kMostEvidenceOfFew = 5.5;
/// Evidence at which a moved hand is as likely as one that held still: users are asked to hold the
/// phone still, so few photographs have one.
constexpr double kEvenEvidence = 3.0;
/// Largest change of a phase by a rotation that is accepted however certain it is.
constexpr double kHarmlessTurnLenses = 0.006;
/// Largest expected change of a phase by a rotation that is only possible: its probability times
/// the change. With this limit about one in a hundred hands that held still is doubted, and none of
/// 200 that turned by 8 degrees a second gave a wrong rig.
constexpr double kMostExpectedLenses = 0.0015;

optics::Rig rig_of(const PhoneFit& fit, const optics::Rig& start) {
  optics::Rig rig = start;
  set_sheet(fit.values.sheet, fit.grid, fit.values.knots, start.panel, rig.sheet);
  return rig;
}

/// Returns the largest difference of the phases of two rigs over the panel, for any of the eyes.
double largest_difference(const optics::Rig& one, const optics::Rig& other,
                          const std::vector<Vec3>& eyes) {
  double largest = 0.0;
  for (const Vec3& at : eyes) {
    const optics::Eye eye{at.x, at.y, at.z};
    largest = std::max(largest, optics::largest_phase_difference(one, eye, other, eye));
  }
  return largest;
}

/// Returns the probabilities of the fits with a hand that moved; the rest is that of no rotation.
std::vector<double> probabilities(const std::vector<TurnedFit>& turned) {
  constexpr double kCertain = 50.0;  // limits the exponential
  double sum = 1.0;
  std::vector<double> parts;
  for (const TurnedFit& one : turned) {
    parts.push_back(std::exp(std::min(kCertain, one.evidence - kEvenEvidence)));
    sum += parts.back();
  }
  for (double& part : parts) part /= sum;
  return parts;
}

/// Returns the difference of sheets and knots, in the order of the covariance.
Eigen::VectorXd difference(const FitValues& from, const FitValues& to) {
  Eigen::VectorXd out(kSheetCount + static_cast<Eigen::Index>(from.knots.size()));
  Eigen::Index at = 0;
  for (size_t k = 0; k < from.sheet.size(); ++k) out[at++] = to.sheet[k] - from.sheet[k];
  for (size_t k = 0; k < from.knots.size(); ++k) out[at++] = to.knots[k] - from.knots[k];
  return out;
}

/// Adds a part of the difference between two fits' values to each value of the result.
void add_difference(const PhoneFit& from, const PhoneFit& to, double part, PhoneFit& result) {
  const auto add = [part](auto& values, const auto& less, const auto& more) {
    for (size_t k = 0; k < values.size(); ++k) values[k] += part * (more[k] - less[k]);
  };
  FitValues& values = result.values;
  add(values.camera, from.values.camera, to.values.camera);
  add(values.sheet, from.values.sheet, to.values.sheet);
  add(values.knots, from.values.knots, to.values.knots);
  for (size_t n = 0; n < values.poses.size(); ++n)
    add(values.poses[n], from.values.poses[n], to.values.poses[n]);
  for (size_t c = 0; c < result.colour_gap.size(); ++c)
    result.colour_gap[c].value += part * (to.colour_gap[c].value - from.colour_gap[c].value);
}

}  // namespace

const TurnedFit* moved_hand(const PhoneFit& fit, const optics::Rig& start,
                            const std::vector<Vec3>& eyes) {
  double most = fit.photos.size() > kFewPhotos ? kMostEvidence : kMostEvidenceOfFew;
  const TurnedFit* found = nullptr;
  const optics::Rig still = rig_of(fit, start);
  for (const TurnedFit& turned : fit.turned) {
    if (turned.evidence <= most) continue;
    if (largest_difference(still, rig_of(turned.fit, start), eyes) <= kHarmlessTurnLenses) continue;
    most = turned.evidence;
    found = &turned;
  }
  return found;
}

const TurnedFit* possibly_moved_hand(const PhoneFit& fit, const PhoneFit& mean,
                                     const optics::Rig& start, const std::vector<Vec3>& eyes) {
  if (fit.photos.size() > kFewPhotos) return nullptr;
  const optics::Rig result = rig_of(mean, start);
  const std::vector<double> parts = probabilities(fit.turned);
  double most = kMostExpectedLenses;
  const TurnedFit* found = nullptr;
  for (size_t k = 0; k < parts.size(); ++k) {
    const double expected =
        parts[k] * largest_difference(result, rig_of(fit.turned[k].fit, start), eyes);
    if (expected <= most) continue;
    most = expected;
    found = &fit.turned[k];
  }
  return found;
}

PhoneFit averaged_over_turns(const PhoneFit& fit) {
  PhoneFit out = fit;
  out.turned.clear();
  if (fit.photos.size() > kFewPhotos) return out;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(fit.covariance.rows());
  const std::vector<double> parts = probabilities(fit.turned);
  for (size_t k = 0; k < parts.size(); ++k) {
    const PhoneFit& turned = fit.turned[k].fit;
    const Eigen::VectorXd off = difference(fit.values, turned.values);
    mean += parts[k] * off;
    out.covariance += parts[k] * (turned.covariance - fit.covariance + off * off.transpose());
    add_difference(fit, turned, parts[k], out);
  }
  out.covariance -= mean * mean.transpose();
  return out;
}

}  // namespace lenticule::calib
