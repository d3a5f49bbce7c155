// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/audit.h"

#include <cmath>

namespace lenticule::render {
namespace {

/// Returns the probability of at most `successes` in `tries`, each with probability p in (0, 1).
double cumulative_binomial(uint64_t successes, uint64_t tries, double p) {
  const auto n = static_cast<double>(tries);
  double term = n * std::log1p(-p);  // logarithm of the probability of no success
  double sum = std::exp(term);
  for (uint64_t k = 0; k < successes; ++k) {
    const auto done = static_cast<double>(k);
    term += std::log((n - done) / (done + 1.0)) + std::log(p) - std::log1p(-p);
    sum += std::exp(term);
  }
  return sum;
}

}  // namespace

double bound_of_share(const AuditCounts& counts) {
  constexpr double kDoubt = 0.0001;
  if (counts.sampled == 0 || counts.beyond >= counts.sampled) return 1.0;
  double low = 0.0, high = 1.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (low + high);
    (cumulative_binomial(counts.beyond, counts.sampled, middle) > kDoubt ? low : high) = middle;
  }
  return high;
}

bool needs_retracing(const AuditCounts& band, double most) {
  // Three standard deviations above the count that such a share would give by chance.
  const double expected = most * static_cast<double>(band.sampled);
  return static_cast<double>(band.beyond) > expected + 3.0 * std::sqrt(expected) + 1.0;
}

}  // namespace lenticule::render
