// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/audit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace lenticule::render {
namespace {

/// Limits of the errors that a bound of the mean square tells apart: fine enough that the squares
/// between two limits differ by less than a half.
constexpr std::array kLayers = {1,  2,  3,  4,  5,  6,  8,   10,  12,  16,  20, 24,
                                32, 40, 48, 64, 80, 96, 128, 160, 192, 224, 256};
constexpr size_t kLayerCount = kLayers.size() - 1;
constexpr double kLargestSquare = 255.0 * 255.0;
/// Probability that the bound of one layer is too low.
constexpr double kLayerDoubt = 0.01 / kMeanSquareLooks / double{kLayerCount};

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

/// Returns an upper bound of a share that is too low with the probability `doubt`, at most: by
/// Chernoff's inequality, k successes or fewer in n tries have at most the probability exp(-n D),
/// where D is the relative entropy of k / n and the share. As tight as the exact bound if k is 0.
double chernoff_bound(const AuditCounts& counts, double doubt) {
  if (counts.sampled == 0 || counts.beyond >= counts.sampled) return 1.0;
  const auto n = static_cast<double>(counts.sampled);
  const double seen = static_cast<double>(counts.beyond) / n;
  const auto entropy = [seen](double p) {
    const double hit = seen > 0.0 ? seen * std::log(seen / p) : 0.0;
    return hit + (1.0 - seen) * std::log((1.0 - seen) / (1.0 - p));
  };
  double low = seen, high = 1.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (low + high);
    (n * entropy(middle) < -std::log(doubt) ? low : high) = middle;
  }
  return high;
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

void AuditErrors::add(uint8_t code, uint8_t exact) {
  ++subpixels_[static_cast<size_t>(std::abs(int{code} - int{exact}))];
}

AuditErrors& AuditErrors::operator+=(const AuditErrors& other) {
  for (size_t error = 0; error < subpixels_.size(); ++error)
    subpixels_[error] += other.subpixels_[error];
  return *this;
}

uint64_t AuditErrors::sampled() const {
  return at_least(0);
}

uint64_t AuditErrors::at_least(int error) const {
  return std::accumulate(subpixels_.begin() + error, subpixels_.end(), uint64_t{0});
}

AuditCounts AuditErrors::counts(double tolerated_error) const {
  const double first = std::floor(std::min(tolerated_error, 255.0)) + 1.0;
  return {.sampled = sampled(), .beyond = at_least(static_cast<int>(first))};
}

double AuditErrors::mean_square() const {
  double sum = 0.0;
  for (size_t error = 1; error < subpixels_.size(); ++error)
    sum += static_cast<double>(error * error) * subpixels_[error];
  return sum / static_cast<double>(std::max<uint64_t>(sampled(), 1));
}

double AuditErrors::standard_error() const {
  const auto count = static_cast<double>(sampled());
  if (count < 2.0) return 0.0;
  const double mean = mean_square();
  double sum = 0.0;
  for (size_t error = 0; error < subpixels_.size(); ++error) {
    const double off = static_cast<double>(error * error) - mean;
    sum += off * off * subpixels_[error];
  }
  return std::sqrt(sum / (count * (count - 1.0)));
}

double bound_of_mean_square(const AuditErrors& errors) {
  const uint64_t sampled = errors.sampled();
  double bound = 0.0, before = 0.0;
  for (size_t layer = 0; layer < kLayerCount; ++layer) {
    const double largest = kLayers[layer + 1] - 1;
    const double share = chernoff_bound(
        {.sampled = sampled, .beyond = errors.at_least(kLayers[layer])}, kLayerDoubt);
    bound += (largest * largest - before) * share;
    before = largest * largest;
  }
  return bound;
}

uint32_t sampled_one_in_for(double mean_square, uint64_t subpixels) {
  // None of n samples is off: every share is at most ln(1 / doubt) / n.
  const double samples = 2.0 * kLargestSquare / mean_square * -std::log(kLayerDoubt);
  const double one_in = static_cast<double>(subpixels) / samples;
  return static_cast<uint32_t>(std::clamp(one_in, 2.0, double{kSampledOneIn}));
}

}  // namespace lenticule::render
