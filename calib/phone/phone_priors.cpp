// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/phone_priors.h"

#include <utility>

#include "calib/phone/phone_start.h"

namespace lenticule::calib {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Standard deviations of priors. Principal points of phones are within 0.8 % of the longer side.
constexpr double kAxisSigma = 0.006;
constexpr double kRadialSigma = 0.1, kLargerSigma = 0.1, kShapeSigma = 0.1;
constexpr double kAberrationSigma = 0.02, kSagSigma = 0.05;
constexpr double kBendSigma = 0.01;  ///< second differences of the map, lenses
constexpr double kKnotSigma = 0.1;   ///< lenses; keeps plane and map apart

void add_map_priors(const KnotGrid& grid, const VectorXd& values, NormalEquations& normal) {
  const auto knot = [&](int c, int r) { return PhoneModel::knots_at() + r * grid.columns + c; };
  const auto bend = [&](Index a, Index b, Index c) {
    normal.add({a, b, c}, {1.0, -2.0, 1.0}, values[a] - 2.0 * values[b] + values[c], kBendSigma,
               false);
  };
  for (int r = 0; r < grid.rows; ++r)
    for (int c = 0; c < grid.columns; ++c) {
      if (c + 2 < grid.columns) bend(knot(c, r), knot(c + 1, r), knot(c + 2, r));
      if (r + 2 < grid.rows) bend(knot(c, r), knot(c, r + 1), knot(c, r + 2));
      normal.add({knot(c, r)}, {1.0}, values[knot(c, r)], kKnotSigma, false);
    }
}

}  // namespace

void add_phone_priors(const PhoneModel& model, const PhonePriors& priors, const VectorXd& values,
                      NormalEquations& normal) {
  const auto add = [&](Index at, double sigma) {
    normal.add({at}, {1.0}, values[at] - priors.means[at], sigma, false);
  };
  add(kFocal, priors.focal_sigma);
  add(kCentreX, kAxisSigma * model.longer_px());
  add(kCentreY, kAxisSigma * model.longer_px());
  add(kRadial1, kRadialSigma);
  add(kRadial2, kRadialSigma);
  add(kCameraCount + kGap, kGapSigma * priors.means[kCameraCount + kGap]);
  add(kCameraCount + kShape, kShapeSigma);
  add(kCameraCount + kAberration, kAberrationSigma);
  add(kCameraCount + kSag, kSagSigma);
  for (size_t n = 0; n < model.seen().size(); ++n)
    for (const auto& [place, sigma] : {std::pair(PhoneModel::kBreathing, kOwnFocalSigma),
                                       std::pair(PhoneModel::kShiftX, kOwnCentreSigma),
                                       std::pair(PhoneModel::kShiftY, kOwnCentreSigma),
                                       std::pair(PhoneModel::kLarger, kLargerSigma),
                                       std::pair(PhoneModel::kTurn, priors.turn_sigmas[n]),
                                       std::pair(PhoneModel::kTurn + 1, priors.turn_sigmas[n]),
                                       std::pair(PhoneModel::kTurn + 2, priors.turn_sigmas[n])}) {
      const Index at = model.photo_at(n) + place;
      normal.add({at}, {1.0}, values[at], sigma, false);
    }
  add_map_priors(model.grid(), values, normal);
}

}  // namespace lenticule::calib
