// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/hand_turn.h"

#include <algorithm>
#include <cmath>

#include "optics/model.h"

namespace lenticule::calib {
namespace {

/// Largest evidence of a rotation that is accepted. Four and more photographs determine rotations
/// better than the law of rigs holds.
constexpr double kMostEvidence = 11.5, kMostEvidenceOfFew = 4.0;
/// Evidence at which a moved hand is as likely as one that held still: users are asked to hold the
/// phone still, so few photographs have one.
constexpr double kEvenEvidence = 3.0;
/// Largest change of a phase by a rotation that is accepted however certain it is.
constexpr double kHarmlessTurnLenses = 0.006;
/// Largest expected change of a phase by a rotation that is only possible: its probability times
/// the change. With this limit about one in a hundred hands that held still is doubted, and none of
/// 200 that turned by 8 degrees a second gave a wrong rig.
constexpr double kMostExpectedLenses = 0.00075;

optics::Rig rig_of(const PhoneFit& fit, const optics::Rig& start) {
  optics::Rig rig = start;
  set_sheet(fit.values.sheet, fit.grid, fit.values.knots, start.panel, rig.sheet);
  return rig;
}

/// Returns the largest difference of the phases of two rigs over the panel.
double largest_difference(const optics::Rig& one, const optics::Rig& other,
                          const std::vector<Vec3>& eyes) {
  constexpr int kColumns = 13, kRows = 8, kGreen = 1;
  const optics::OpticalModel a(one), b(other);
  double largest = 0.0;
  for (const Vec3& at : eyes) {
    const optics::Eye eye{at.x, at.y, at.z};
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const double x = one.panel.width_px * static_cast<double>(c) / (kColumns - 1);
        const double y = one.panel.height_px * static_cast<double>(r) / (kRows - 1);
        const double off = a.phase(x, y, kGreen, eye) - b.phase(x, y, kGreen, eye);
        largest = std::max(largest, std::abs(off - std::round(off)));
      }
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
