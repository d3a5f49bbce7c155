// SPDX-License-Identifier: Apache-2.0
#include "calib/by_eye/belief.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "frames/charts/chart.h"

namespace lenticule::calib {
namespace {

using frames::kBands;

constexpr double kStep = 0.05;  ///< distance of two values
/// Share of answers that have nothing to do with the chart. A higher share than the real one costs
/// a few more questions; a lower one costs certainty.
constexpr double kWrongShare = 0.15;
constexpr double kAnswers = kBands + 1.0;  ///< the bands, and none of them
/// Spread of right answers: in bands, and in lenses where bands are hard to tell apart.
constexpr double kSpreadBands = 0.7;
constexpr double kSpreadLenses = 0.12;
/// A value this many bands beyond the chart may be taken for its last band.
constexpr double kNearBands = 4.0;

double bell(double x) {
  return std::exp(-0.5 * x * x);
}

/// Returns the probability of `band` as a right answer if the best band would be `ideal`, which may
/// lie between two bands or beyond the chart.
double right_answer(double ideal, double spread, int band) {
  const double beyond = std::abs(ideal - 0.5 * (kBands - 1)) - 0.5 * kBands;
  const bool none = band < 0 || band >= kBands;
  if (beyond > kNearBands) return none ? 1.0 : 0.0;
  if (beyond > 0.0) {
    const int last = ideal < 0.0 ? 0 : kBands - 1;
    return none ? 0.7 : band == last ? 0.3 : 0.0;
  }
  if (none) return beyond > -1.0 ? 0.1 : 0.0;
  double sum = 0.0;
  for (int n = 0; n < kBands; ++n) sum += bell((n - ideal) / spread);
  return bell((band - ideal) / spread) / sum;
}

}  // namespace

Belief::Belief(double range)
    : range_(range), probability_(static_cast<size_t>(std::ceil(2.0 * range / kStep)) + 1) {
  std::fill(probability_.begin(), probability_.end(),
            1.0 / static_cast<double>(probability_.size()));
}

double Belief::value_of(size_t n) const {
  return -range_ + static_cast<double>(n) * kStep;
}

void Belief::add(double centre, double reach, int band) {
  const double width = 2.0 * reach / (kBands - 1);
  const double spread = std::max(kSpreadBands, kSpreadLenses / width);
  for (size_t n = 0; n < probability_.size(); ++n) {
    const double ideal = (value_of(n) - centre) / width + 0.5 * (kBands - 1);
    probability_[n] *=
        kWrongShare / kAnswers + (1.0 - kWrongShare) * right_answer(ideal, spread, band);
  }
  const double sum = std::accumulate(probability_.begin(), probability_.end(), 0.0);
  for (double& p : probability_) p /= sum;
}

double Belief::best() const {
  // Several neighbours can be equally probable: the middle of them.
  const auto first = std::max_element(probability_.begin(), probability_.end());
  const auto last =
      std::find_if(first, probability_.end(), [&](double p) { return p < *first * (1.0 - 1e-9); });
  return value_of(static_cast<size_t>(first - probability_.begin())) +
         0.5 * kStep * static_cast<double>(last - first - 1);
}

double Belief::probability_near(double value, double distance) const {
  double sum = 0.0;
  for (size_t n = 0; n < probability_.size(); ++n)
    if (std::abs(value_of(n) - value) <= distance + 0.5 * kStep) sum += probability_[n];
  return sum;
}

}  // namespace lenticule::calib
