// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton with Levenberg's damping on dense normal equations: every observation depends on
// camera, sheet, one photograph and at most 16 knots, so that six photographs take milliseconds a
// step.
#include "calib/phone/phone_fit.h"

#include <ceres/jet.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "base/statistics.h"
#include "calib/fit/projection.h"
#include "calib/linear_algebra.h"
#include "calib/phone/phone_observations.h"

namespace lenticule::calib {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr size_t kGreen = 1;

/// Unknowns of one photograph: the pose, its own camera, then these.
constexpr int kOwn = kPoseCount, kBreathing = kOwn + kOwnFocal, kShiftX = kOwn + kOwnCentreX,
              kShiftY = kOwn + kOwnCentreY, kLarger = kOwn + kOwnCount, kTurn = kLarger + 1,
              kPhotoCount = kTurn + 3;
constexpr int kLocal = kCameraCount + kSheetCount + kPhotoCount;
using Jet = ceres::Jet<double, kLocal>;

// Standard deviations of priors. Principal points of phones are within 0.8 % of the longer side.
constexpr double kAxisSigma = 0.006;
constexpr double kRadialSigma = 0.1, kLargerSigma = 0.1, kGapSigma = 0.15, kShapeSigma = 0.1;
constexpr double kAberrationSigma = 0.02, kSagSigma = 0.05;
/// Rotation of the hand while the rows are read, radians: 1 degree a second for 17 ms.
constexpr double kTurnSigma = 3e-4;
/// The same for a hand that moved: 10 degrees a second. A picture that fits the others only with
/// such a rotation is a mistake.
constexpr double kMovedTurnSigma = 3e-3;
constexpr double kBendSigma = 0.01;  ///< second differences of the map, lenses
constexpr double kKnotSigma = 0.1;   ///< lenses; keeps plane and map apart
/// Smallest standard errors: errors of neighbouring blocks and corners are alike.
constexpr double kLeastPhaseSigma = 0.003, kLeastCornerPx = 0.15;

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

/// Returns the point of the lens-apex plane that a pixel sees. The rows are read one after the
/// other while the hand turns the camera; `row` is -1/2 for the first and 1/2 for the last.
template <class T>
PlanePoint<T> seen_point(const T* camera, const T* photo, Vec2 pixel, double row) {
  const PlanePoint<T> d = undistorted(camera, pixel.x, pixel.y);
  const T* turn = photo + kTurn;
  const T in_camera[3] = {d.x + row * (turn[1] - turn[2] * d.y),
                          d.y + row * (turn[2] * d.x - turn[0]),
                          1.0 + row * (turn[0] * d.y - turn[1] * d.x)};
  const T back[3] = {-photo[0], -photo[1], -photo[2]};
  T along[3];
  ceres::AngleAxisRotatePoint(back, in_camera, along);
  const T* pupil = photo + kPupil;
  const T steps = -pupil[2] / along[2];
  return {pupil[0] + steps * along[0], pupil[1] + steps * along[1]};
}

struct Normal {
  MatrixXd square;
  VectorXd gradient;
  double cost = 0.0;
  explicit Normal(Index size)
      : square(MatrixXd::Zero(size, size)), gradient(VectorXd::Zero(size)) {}
};

class Joint {
 public:
  Joint(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart,
        const Estimate& focal)
      : photos_(photos),
        panel_(chart.start.panel),
        longer_(std::max(photos[0].width, photos[0].height)),
        focal_(focal),
        start_(sheet_start(chart.start)) {
    for (const PhotoFindings& photo : photos) seen_.push_back(phone_observations(photo, chart));
    knots_at_ = kCameraCount + kSheetCount;
    photos_at_ = knots_at_ + grid_.count();
    size_ = photos_at_ + kPhotoCount * static_cast<Index>(photos.size());
    values_ = VectorXd::Zero(size_);
    phase_sigma_.assign(photos.size(), 0.01);
    corner_sigma_.assign(photos.size(), 0.5);
    begin();
  }

  std::optional<PhoneFit> run() {
    constexpr int kRescalings = 3;
    for (int round = 0; round < kRescalings; ++round) {
      if (!solve()) return std::nullopt;
      rescale();
    }
    if (!solve()) return std::nullopt;
    PhoneFit fit = finish();
    measure_turns(fit);
    return fit;
  }

 private:
  double* photo(size_t n) {
    return values_.data() + photos_at_ + kPhotoCount * static_cast<Index>(n);
  }
  double* sheet() { return values_.data() + kCameraCount; }

  void begin() {
    double focal = 0.0, radial = 0.0, across = 0.0, down = 0.0;
    const double share = 1.0 / static_cast<double>(photos_.size());
    for (size_t n = 0; n < photos_.size(); ++n) {
      const PhotoPose& pose = *photos_[n].pose;
      focal += share * pose.focal_px;
      radial -= share * pose.distortion;
      const PoseValues values = pose_values(pose);
      std::copy(values.begin(), values.end(), photo(n));
      photo(n)[kLarger] = pose.tags_larger;
      const LensPlane plane = plane_of(photos_[n].rig);
      across += 0.5 * share * plane.across;
      down += 0.5 * share * plane.down;
    }
    values_[kFocal] = focal;
    values_[kCentreX] = 0.5 * photos_[0].width;
    values_[kCentreY] = 0.5 * photos_[0].height;
    values_[kRadial1] = radial;
    std::copy(start_.values.begin(), start_.values.end(), sheet());
    // The photographs' own poses have one focal length and principal point each.
    for (size_t n = 0; n < photos_.size(); ++n) {
      photo(n)[kBreathing] = photos_[n].pose->focal_px / focal - 1.0;
      photo(n)[kShiftX] = (photos_[n].pose->middle_px.x - values_[kCentreX]) / longer_;
      photo(n)[kShiftY] = (photos_[n].pose->middle_px.y - values_[kCentreY]) / longer_;
    }
    sheet()[kAcross] = across;
    sheet()[kDown] = down;
    prior_ = values_;
    prior_[kFocal] = focal_.value;
    prior_[kRadial1] = 0.0;
    search_gap();
  }

  /// Tries gaps within 30 %. At the right one a single offset explains the phases of all
  /// photographs up to whole lenses.
  void search_gap() {
    constexpr int kSteps = 60;
    const double start = start_.values[kGap];
    double best = -1.0, best_gap = start, best_offset = 0.0;
    sheet()[kOffset] = 0.0;
    for (int k = -kSteps; k <= kSteps; ++k) {
      sheet()[kGap] = start * (1.0 + 0.3 * k / kSteps);
      std::complex<double> sum;
      for (size_t n = 0; n < seen_.size(); ++n) {
        std::complex<double> own;
        for (const FringeSeen& seen : seen_[n].phases)
          own += std::polar(1.0, 2.0 * std::numbers::pi * phase_rest(n, seen));
        sum += own / static_cast<double>(std::max<size_t>(seen_[n].phases.size(), 1));
      }
      const double off = 0.3 * k / kSteps / kGapSigma;
      const double score = std::abs(sum) / static_cast<double>(seen_.size()) - 0.02 * off * off;
      if (score <= best) continue;
      best = score;
      best_gap = sheet()[kGap];
      // rest = turns - (comb - lens) with offset 0: the offset is minus its mean.
      best_offset = -std::arg(sum) / (2.0 * std::numbers::pi);
    }
    sheet()[kGap] = best_gap;
    sheet()[kOffset] = best_offset;
  }

  double row_of(Vec2 pixel) const { return pixel.y / photos_[0].height - 0.5; }

  template <class T>
  T phase_of(const T* camera, const T* sheet, const T* photo, const FringeSeen& seen,
             PlanePoint<T>& lens) const {
    T own[kCameraCount];
    camera_of_view(camera, photo + kOwn, longer_, own);
    lens = seen_point(own, photo, seen.pixel, row_of(seen.pixel));
    return fringe_turns(seen.fringe, panel_, fringe_point(photo, sheet, panel_, lens)) -
           lens_coordinate(sheet, panel_, lens);
  }

  /// Returns the derivative of phase_of() by the gap, lenses per mm.
  double phase_per_gap(size_t n, const FringeSeen& seen) {
    constexpr double kPart = 1e-3;
    SheetParameters more;
    std::copy_n(sheet(), kSheetCount, more.begin());
    more[kGap] *= 1.0 + kPart;
    PlanePoint<double> lens{};
    return (phase_of<double>(values_.data(), more.data(), photo(n), seen, lens) -
            phase_of<double>(values_.data(), sheet(), photo(n), seen, lens)) /
           (kPart * sheet()[kGap]);
  }

  double map_at(const std::vector<KnotWeight>& weights) const {
    double sum = 0.0;
    for (const KnotWeight& w : weights) sum += w.weight * values_[knots_at_ + w.knot];
    return sum;
  }
  std::vector<KnotWeight> weights_at(double x_mm, double y_mm) const {
    return knot_weights(grid_, {panel_.x_px(x_mm), panel_.y_px(y_mm)}, panel_.width_px,
                        panel_.height_px);
  }

  /// Returns the phase residual without whole lenses.
  double phase_rest(size_t n, const FringeSeen& seen) {
    PlanePoint<double> lens{};
    const double phase = phase_of<double>(values_.data(), sheet(), photo(n), seen, lens);
    const double rest = seen.turns - phase + map_at(weights_at(lens.x, lens.y));
    return rest - std::round(rest);
  }

  template <class T>
  void corner_rest(const T* camera, const T* sheet, const T* photo, const CornerSeen& seen,
                   double pixels_per_mm, T* out) const {
    T own[kCameraCount];
    camera_of_view(camera, photo + kOwn, longer_, own);
    const PlanePoint<T> lens = seen_point(own, photo, seen.pixel, row_of(seen.pixel));
    const PlanePoint<T> at = wide_pattern_point(photo, sheet, panel_, lens);
    out[0] = (at.x - seen.panel_mm.x - photo[kLarger] * seen.from_middle_mm.x) * pixels_per_mm;
    out[1] = (at.y - seen.panel_mm.y - photo[kLarger] * seen.from_middle_mm.y) * pixels_per_mm;
  }

  /// Adds weight (rest + slope delta)^2 / 2 with Cauchy's loss at three standard errors.
  static void add(Normal& normal, const std::vector<Index>& places,
                  const std::vector<double>& slope, double rest, double sigma, bool robust) {
    const double scaled = rest / sigma;
    constexpr double kOutlier = 3.0;
    const double ratio = scaled / kOutlier;
    const double loss = robust ? 1.0 / (1.0 + ratio * ratio) : 1.0;
    normal.cost +=
        robust ? 0.5 * kOutlier * kOutlier * std::log1p(ratio * ratio) : 0.5 * scaled * scaled;
    const double weight = loss / (sigma * sigma);
    for (size_t a = 0; a < places.size(); ++a) {
      normal.gradient[places[a]] += weight * slope[a] * rest;
      for (size_t b = 0; b < places.size(); ++b)
        normal.square(places[a], places[b]) += weight * slope[a] * slope[b];
    }
  }

  Normal of_photo(size_t n) {
    Normal normal(size_);
    std::array<Jet, kLocal> jets;
    std::vector<Index> local;
    for (int k = 0; k < kLocal; ++k) {
      const Index at =
          k < kCameraCount + kSheetCount
              ? k
              : photos_at_ + kPhotoCount * static_cast<Index>(n) + (k - kCameraCount - kSheetCount);
      local.push_back(at);
      jets[static_cast<size_t>(k)] = Jet(values_[at], k);
    }
    const Jet* camera = jets.data();
    const Jet* sheet = camera + kCameraCount;
    const Jet* own = sheet + kSheetCount;
    std::vector<double> slope;
    for (const CornerSeen& seen : seen_[n].corners) {
      Jet rest[2];
      corner_rest(camera, sheet, own, seen, seen_[n].pixels_per_mm, rest);
      for (const Jet& r : rest) {
        slope.assign(r.v.data(), r.v.data() + kLocal);
        add(normal, local, slope, r.a, corner_sigma_[n], true);
      }
    }
    for (const FringeSeen& seen : seen_[n].phases) {
      PlanePoint<Jet> lens;
      const Jet phase = phase_of<Jet>(camera, sheet, own, seen, lens);
      const std::vector<KnotWeight> weights = weights_at(lens.x.a, lens.y.a);
      const double rest = seen.turns - phase.a + map_at(weights);
      std::vector<Index> places = local;
      slope.assign(phase.v.data(), phase.v.data() + kLocal);
      for (double& s : slope) s = -s;
      for (const KnotWeight& w : weights) {
        places.push_back(knots_at_ + w.knot);
        slope.push_back(w.weight);
      }
      add(normal, places, slope, rest - std::round(rest),
          phase_sigma_[n] / std::sqrt(std::max(seen.weight, 1e-3)), true);
    }
    return normal;
  }

  void add_prior(Normal& normal, Index at, double sigma) const {
    add(normal, {at}, {1.0}, values_[at] - prior_[at], sigma, false);
  }

  Normal of_priors() const {
    Normal normal(size_);
    add_prior(normal, kFocal, focal_.sigma);
    add_prior(normal, kCentreX, kAxisSigma * longer_);
    add_prior(normal, kCentreY, kAxisSigma * longer_);
    add_prior(normal, kRadial1, kRadialSigma);
    add_prior(normal, kRadial2, kRadialSigma);
    add_prior(normal, kCameraCount + kGap, kGapSigma * start_.values[kGap]);
    add_prior(normal, kCameraCount + kShape, kShapeSigma);
    add_prior(normal, kCameraCount + kAberration, kAberrationSigma);
    add_prior(normal, kCameraCount + kSag, kSagSigma);
    for (size_t n = 0; n < seen_.size(); ++n) {
      const Index at = photos_at_ + kPhotoCount * static_cast<Index>(n);
      for (const auto& [place, sigma] :
           {std::pair(kBreathing, kOwnFocalSigma), std::pair(kShiftX, kOwnCentreSigma),
            std::pair(kShiftY, kOwnCentreSigma), std::pair(kLarger, kLargerSigma),
            std::pair(kTurn, turn_sigma_), std::pair(kTurn + 1, turn_sigma_),
            std::pair(kTurn + 2, turn_sigma_)})
        add(normal, {at + place}, {1.0}, values_[at + place], sigma, false);
    }
    add_map_priors(normal);
    return normal;
  }

  void add_map_priors(Normal& normal) const {
    const auto knot = [&](int c, int r) { return knots_at_ + r * grid_.columns + c; };
    const auto bend = [&](Index a, Index b, Index c) {
      add(normal, {a, b, c}, {1.0, -2.0, 1.0}, values_[a] - 2.0 * values_[b] + values_[c],
          kBendSigma, false);
    };
    for (int r = 0; r < grid_.rows; ++r)
      for (int c = 0; c < grid_.columns; ++c) {
        if (c + 2 < grid_.columns) bend(knot(c, r), knot(c + 1, r), knot(c + 2, r));
        if (r + 2 < grid_.rows) bend(knot(c, r), knot(c, r + 1), knot(c, r + 2));
        add(normal, {knot(c, r)}, {1.0}, values_[knot(c, r)], kKnotSigma, false);
      }
  }

  Normal all() {
    Normal sum = of_priors();
    for (size_t n = 0; n < seen_.size(); ++n) {
      const Normal own = of_photo(n);
      sum.square += own.square;
      sum.gradient += own.gradient;
      sum.cost += own.cost;
    }
    return sum;
  }

  /// Solves (square + damping diagonal) x = right, scaled to a unit diagonal.
  static VectorXd solved(const MatrixXd& square, const VectorXd& right, double damping) {
    const VectorXd scale = square.diagonal().array().max(1e-30).rsqrt();
    MatrixXd scaled = scale.asDiagonal() * square * scale.asDiagonal();
    scaled.diagonal().array() += damping;
    return scale.asDiagonal() * solve_symmetric(scaled, scale.asDiagonal() * right);
  }

  bool solve() {
    constexpr int kMostSteps = 40;
    double damping = 1e-6;
    Normal now = all();
    for (int step = 0; step < kMostSteps; ++step) {
      const VectorXd before = values_;
      values_ -= solved(now.square, now.gradient, damping);
      if (!values_.allFinite()) return false;
      Normal next = all();
      if (!(next.cost <= now.cost)) {
        values_ = before;
        damping *= 30.0;
        if (damping > 1e6) return true;
        continue;
      }
      const bool settled = now.cost - next.cost < 1e-6 * now.cost;
      now = std::move(next);
      damping = std::max(damping / 10.0, 1e-10);
      if (settled) return true;
    }
    return true;
  }

  std::vector<double> phase_rests(size_t n) {
    std::vector<double> rests;
    for (const FringeSeen& seen : seen_[n].phases) rests.push_back(phase_rest(n, seen));
    return rests;
  }
  std::vector<double> corner_rests(size_t n) {
    std::vector<double> rests;
    for (const CornerSeen& seen : seen_[n].corners) {
      double rest[2];
      corner_rest<double>(values_.data(), sheet(), photo(n), seen, seen_[n].pixels_per_mm, rest);
      rests.insert(rests.end(), rest, rest + 2);
    }
    return rests;
  }
  void rescale() {
    constexpr double kOfMedian = 1.4826;  // normal distribution
    for (size_t n = 0; n < seen_.size(); ++n) {
      phase_sigma_[n] = std::max(kLeastPhaseSigma, kOfMedian * median_magnitude(phase_rests(n)));
      corner_sigma_[n] = std::max(kLeastCornerPx, kOfMedian * median_magnitude(corner_rests(n)));
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

  /// Returns the inverse of the normal equations, all unknowns.
  MatrixXd covariance() {
    const MatrixXd square = all().square;
    const VectorXd scale = square.diagonal().array().max(1e-30).rsqrt();
    const MatrixXd scaled = scale.asDiagonal() * square * scale.asDiagonal();
    return scale.asDiagonal() * inverse_of_symmetric(scaled) * scale.asDiagonal();
  }

  /// Fits once more with free rotations, which shows a hand that moved: the usual fit spreads such
  /// an error over poses, axes and sheet.
  void measure_turns(PhoneFit& fit) {
    turn_sigma_ = kMovedTurnSigma;
    if (!solve()) return;
    const MatrixXd spread = covariance();
    for (size_t n = 0; n < seen_.size(); ++n) {
      const Index at = photos_at_ + kPhotoCount * static_cast<Index>(n) + kTurn;
      const VectorXd turn = values_.segment(at, 3);
      fit.photos[n].turn = turn.norm();
      fit.photos[n].turn_pull =
          std::sqrt(turn.dot(solve_symmetric(spread.block(at, at, 3, 3), turn).col(0)));
    }
  }

  /// Measures the gap of each colour. Phases move by the gap's change times their slope over it, so
  /// the colours' differences from the mean of the channels show the differences of their gaps.
  std::array<Estimate, 3> colour_gaps(double gap_sigma) {
    const double gap = sheet()[kGap];
    std::array<Estimate, 3> gaps;
    for (size_t c = 0; c < gaps.size(); ++c) {
      double product = 0.0, square = 0.0, rest = 0.0, count = 0.0;
      const auto for_each = [&](const auto& use) {
        for (size_t n = 0; n < seen_.size(); ++n)
          for (const FringeSeen& seen : seen_[n].phases)
            use(seen.weight, seen.colour_turns[c], phase_per_gap(n, seen));
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

  PhotoFit photo_fit(size_t n, const MatrixXd& covariance) {
    const double* own = photo(n);
    PhotoFit out;
    out.breathing = own[kBreathing];
    out.shift = {own[kShiftX], own[kShiftY]};
    out.breathing_pull = std::abs(out.breathing) / kOwnFocalSigma;
    out.shift_pull = std::hypot(out.shift.x, out.shift.y) / kOwnCentreSigma;
    out.phase_rests = phase_rests(n);
    // Blocks that are seen steeply have little contrast.
    out.phase_rms = rms(out.phase_rests, [&](size_t k) { return seen_[n].phases[k].weight; });
    out.corner_rms_px = rms(corner_rests(n), [](size_t) { return 1.0; });
    const Index at = photos_at_ + kPhotoCount * static_cast<Index>(n) + kPupil;
    out.eye_sigma_mm = {std::sqrt(covariance(at, at)), std::sqrt(covariance(at + 1, at + 1)),
                        std::sqrt(covariance(at + 2, at + 2))};
    return out;
  }

  PhoneFit finish() {
    PhoneFit fit;
    fit.grid = grid_;
    std::copy_n(values_.data(), kCameraCount, fit.values.camera.begin());
    std::copy_n(sheet(), kSheetCount, fit.values.sheet.begin());
    fit.values.knots.assign(values_.data() + knots_at_, values_.data() + photos_at_);
    const MatrixXd inverse = covariance();
    const Index count = kSheetCount + grid_.count();
    fit.covariance = inverse.block(kCameraCount, kCameraCount, count, count);
    fit.colour_gap = colour_gaps(std::sqrt(fit.covariance(kGap, kGap)));
    fit.values.sheet[kGap] = fit.colour_gap[kGreen].value;
    for (size_t n = 0; n < seen_.size(); ++n) {
      PoseValues pose{};
      std::copy_n(photo(n), kPoseCount, pose.begin());
      fit.values.poses.push_back(pose);
      fit.photos.push_back(photo_fit(n, inverse));
    }
    return fit;
  }

  const std::vector<PhotoFindings>& photos_;
  const optics::Panel& panel_;
  double longer_;
  Estimate focal_;
  SheetStart start_;
  KnotGrid grid_{.columns = 13, .rows = 8};
  std::vector<PhoneObservations> seen_;
  Index knots_at_ = 0, photos_at_ = 0, size_ = 0;
  VectorXd values_, prior_;
  std::vector<double> phase_sigma_, corner_sigma_;
  double turn_sigma_ = kTurnSigma;
};

}  // namespace

std::optional<PhoneFit> fit_phone(const std::vector<PhotoFindings>& photos,
                                  const SinglePhotoChart& chart, const Estimate& focal_px) {
  if (photos.size() < 2) return std::nullopt;
  return Joint(photos, chart, focal_px).run();
}

}  // namespace lenticule::calib
