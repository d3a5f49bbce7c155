// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton with Levenberg's damping on dense normal equations: every observation depends on
// camera, sheet, one photograph and at most 16 knots, so that six photographs take milliseconds a
// step.
#include "calib/phone/phone_fit.h"

#include <ceres/jet.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/statistics.h"
#include "calib/linear_algebra.h"
#include "calib/phone/colour_gaps.h"
#include "calib/phone/normal_equations.h"
#include "calib/phone/phone_model.h"
#include "calib/phone/phone_priors.h"
#include "calib/phone/phone_start.h"

namespace lenticule::calib {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr size_t kGreen = 1;

constexpr int kLocal = kCameraCount + kSheetCount + PhoneModel::kPhotoCount;
using Jet = ceres::Jet<double, kLocal>;

/// Rotation of the hand while the rows are read, radians: 1 degree a second for 17 ms.
constexpr double kTurnSigma = 3e-4;
/// The same for a hand that moved: 10 degrees a second. A picture that fits the others only with
/// such a rotation is a mistake.
constexpr double kMovedTurnSigma = 3e-3;
/// Smallest standard errors: errors of neighbouring blocks and corners are alike. Up to kFewPhotos
/// photographs determine axes and rotations so badly that all that fringes and tags say is needed;
/// more photographs show where the law of rigs does not hold.
constexpr double kLeastPhaseSigma = 0.003, kLeastPhaseSigmaOfFew = 0.001;
constexpr double kLeastCornerPx = 0.15, kLeastCornerPxOfFew = 0.03;

class Joint {
 public:
  Joint(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart,
        const Estimate& focal)
      : model_(photos, chart),
        phase_sigma_(photos.size(), 0.01),
        corner_sigma_(photos.size(), 0.5) {
    PhoneStart start = phone_start(model_, photos, chart.start, focal);
    values_ = std::move(start.values);
    priors_ = {std::move(start.prior), focal.sigma, usual_turns()};
  }

  std::optional<PhoneFit> run() {
    constexpr int kRescalings = 3;
    for (int round = 0; round < kRescalings; ++round) {
      if (!solve()) return std::nullopt;
      rescale();
    }
    if (!solve()) return std::nullopt;
    PhoneFit fit = finish(all().inverse());
    const VectorXd found = values_;
    for (size_t n = 0; n < model_.seen().size(); ++n) {
      if (auto turned = turned_fit(n)) fit.turned.push_back(std::move(*turned));
      values_ = found;
    }
    return fit;
  }

 private:
  NormalEquations of_photo(size_t n) const {
    NormalEquations normal(model_.size());
    std::array<Jet, kLocal> jets;
    std::vector<Index> local;
    for (int k = 0; k < kLocal; ++k) {
      const Index at = k < kCameraCount + kSheetCount
                           ? k
                           : model_.photo_at(n) + (k - kCameraCount - kSheetCount);
      local.push_back(at);
      jets[static_cast<size_t>(k)] = Jet(values_[at], k);
    }
    const Jet* camera = jets.data();
    const Jet* sheet = camera + kCameraCount;
    const Jet* own = sheet + kSheetCount;
    const PhoneObservations& photo = model_.seen()[n];
    std::vector<double> slope;
    for (const CornerSeen& seen : photo.corners) {
      Jet rest[2];
      model_.corner_rest(camera, sheet, own, seen, photo.pixels_per_mm, rest);
      for (const Jet& r : rest) {
        slope.assign(r.v.data(), r.v.data() + kLocal);
        normal.add(local, slope, r.a, corner_sigma_[n], true);
      }
    }
    for (const FringeSeen& seen : photo.phases) {
      PlanePoint<Jet> lens;
      const Jet phase = model_.phase_of<Jet>(camera, sheet, own, seen, lens);
      const std::vector<KnotWeight> weights = model_.weights_at(lens.x.a, lens.y.a);
      const double rest = seen.turns - phase.a + PhoneModel::map_at(values_, weights);
      std::vector<Index> places = local;
      slope.assign(phase.v.data(), phase.v.data() + kLocal);
      for (double& s : slope) s = -s;
      for (const KnotWeight& w : weights) {
        places.push_back(PhoneModel::knots_at() + w.knot);
        slope.push_back(w.weight);
      }
      normal.add(places, slope, rest - std::round(rest),
                 phase_sigma_[n] / std::sqrt(std::max(seen.weight, 1e-3)), true);
    }
    return normal;
  }

  NormalEquations all() const {
    NormalEquations sum(model_.size());
    add_phone_priors(model_, priors_, values_, sum);
    for (size_t n = 0; n < model_.seen().size(); ++n) sum += of_photo(n);
    return sum;
  }

  bool solve() {
    constexpr int kMostSteps = 40;
    double damping = 1e-6;
    NormalEquations now = all();
    for (int step = 0; step < kMostSteps; ++step) {
      const VectorXd before = values_;
      values_ -= now.solved(damping);
      if (!values_.allFinite()) return false;
      NormalEquations next = all();
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

  void rescale() {
    constexpr double kOfMedian = 1.4826;  // normal distribution
    const bool few = model_.seen().size() <= kFewPhotos;
    const double least_phase = few ? kLeastPhaseSigmaOfFew : kLeastPhaseSigma;
    const double least_corner = few ? kLeastCornerPxOfFew : kLeastCornerPx;
    for (size_t n = 0; n < model_.seen().size(); ++n) {
      phase_sigma_[n] =
          std::max(least_phase, kOfMedian * median_magnitude(model_.phase_rests(values_, n)));
      corner_sigma_[n] =
          std::max(least_corner, kOfMedian * median_magnitude(model_.corner_rests(values_, n)));
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

  /// Returns the standard deviations of the rotations of hands that hold still.
  std::vector<double> usual_turns() const {
    return std::vector<double>(model_.seen().size(), kTurnSigma);
  }

  /// Fits once more with a free rotation during photograph n, which shows a hand that moved: the
  /// usual fit spreads such an error over poses, axes and sheet. The Bayes factor is that of no
  /// rotation against a prior of kMovedTurnSigma, by Savage and Dickey: the density of a Gaussian
  /// posterior at no rotation, over that of the prior.
  std::optional<TurnedFit> turned_fit(size_t n) {
    priors_.turn_sigmas = usual_turns();
    priors_.turn_sigmas[n] = kMovedTurnSigma;
    if (!solve()) return std::nullopt;
    const MatrixXd inverse = all().inverse();
    const Index at = model_.photo_at(n) + PhoneModel::kTurn;
    const Eigen::Vector3d turn = values_.segment(at, 3);
    const Eigen::Matrix3d spread = inverse.block(at, at, 3, 3);
    const double pull_squared = turn.dot(solve_symmetric(spread, turn).col(0));
    const double volume = spread.determinant() / std::pow(kMovedTurnSigma, 6);
    return TurnedFit{n, turn.norm(), 0.5 * (pull_squared + std::log(volume)), finish(inverse)};
  }

  PhotoFit photo_fit(size_t n, const MatrixXd& covariance) const {
    const double* own = values_.data() + model_.photo_at(n);
    PhotoFit out;
    out.breathing = own[PhoneModel::kBreathing];
    out.shift = {own[PhoneModel::kShiftX], own[PhoneModel::kShiftY]};
    out.breathing_pull = std::abs(out.breathing) / kOwnFocalSigma;
    out.shift_pull = std::hypot(out.shift.x, out.shift.y) / kOwnCentreSigma;
    out.phase_rests = model_.phase_rests(values_, n);
    // Blocks that are seen steeply have little contrast.
    const std::vector<FringeSeen>& phases = model_.seen()[n].phases;
    out.phase_rms = rms(out.phase_rests, [&](size_t k) { return phases[k].weight; });
    out.corner_rms_px = rms(model_.corner_rests(values_, n), [](size_t) { return 1.0; });
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
    fit.values.knots.assign(values + PhoneModel::knots_at(), values + model_.photo_at(0));
    const Index count = kSheetCount + model_.grid().count();
    fit.covariance = inverse.block(kCameraCount, kCameraCount, count, count);
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
  PhonePriors priors_;
  VectorXd values_;
  std::vector<double> phase_sigma_, corner_sigma_;
};

}  // namespace

std::optional<PhoneFit> fit_phone(const std::vector<PhotoFindings>& photos,
                                  const SinglePhotoChart& chart, const Estimate& focal_px) {
  if (photos.size() < 2) return std::nullopt;
  return Joint(photos, chart, focal_px).run();
}

}  // namespace lenticule::calib
