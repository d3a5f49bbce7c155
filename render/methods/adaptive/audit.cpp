// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/audit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Largest squared error, rounded up so that no factor of bound_of_mean_square() is 0.
constexpr double kLargestSquare = 256.0 * 256.0;
/// Probability that the bound of a mean square is too low.
constexpr double kSquareDoubt = 0.01 / kMeanSquareLooks;
/// Part of it that is spent on the first factor, which is the best one unless errors are very
/// large.
constexpr double kFirstPart = 0.9;

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

/// With x = error^2 / kLargestSquare and 0 < f <= 1, the expected product of 1 - f x over all
/// samples is at most exp(-f n m), where n m is the sum of the expected x of the samples. So by
/// Markov's inequality the product exceeds exp(-f n m) / doubt with at most the probability
/// `doubt`, for samples from any errors. The smallest of the bounds with a few f holds if their
/// doubts add up.
double bound_of_mean_square(const AuditErrors& errors) {
  constexpr std::array kFactors = {1.0, 0.5, 0.25, 0.125};
  const auto sampled = static_cast<double>(errors.sampled());
  double least = 255.0 * 255.0;
  for (size_t n = 0; n < kFactors.size(); ++n) {
    const double part = n == 0 ? kFirstPart : (1.0 - kFirstPart) / (kFactors.size() - 1.0);
    double sum = -std::log(part * kSquareDoubt);
    for (int error = 1; error < 256; ++error)
      sum -= static_cast<double>(errors.exactly(error)) *
             std::log1p(-kFactors[n] * error * error / kLargestSquare);
    least = std::min(least, kLargestSquare * sum / (kFactors[n] * sampled));
  }
  return least;
}

uint32_t sampled_one_in_for(double mean_square, uint64_t subpixels) {
  constexpr double kParts = 2.9;  // one of them is spent on errors that no sample shows
  const double samples =
      kParts * kLargestSquare / mean_square * -std::log(kFirstPart * kSquareDoubt);
  const double one_in = static_cast<double>(subpixels) / samples;
  return static_cast<uint32_t>(std::clamp(one_in, 2.0, double{kSampledOneIn}));
}

SampledSubpixels::SampledSubpixels(const PrimaryPackets& packets, const TilePlan& plan,
                                   const Footprint& centre)
    : plan_(plan), centre_(centre), maker_(packets), packet_(1) {
  init_packets(packet_);
}

void SampledSubpixels::trace(const Scene& scene, int first_row, PacketTracer& tracer) {
  std::ranges::sort(subpixels_, {}, [&](const Subpixel& s) { return std::pair(column(s), s.row); });
  const int first_tile = first_row / TilePlan::kRows * plan_.per_band();
  int tiles_begun = 0;
  Tile tile{};
  size_t in_packet = 0;
  for (size_t n = 0; n < subpixels_.size(); ++n) {
    const Subpixel& s = subpixels_[n];
    while (tiles_begun == 0 || column(s) >= tile.column_begin + tile.columns) {
      LENTICULE_CHECK(tiles_begun < plan_.per_band());
      tile = plan_.tile(first_tile + tiles_begun++);
      if (column(s) < tile.column_begin + tile.columns) maker_.start_few(scene, tile, centre_);
    }
    maker_.ray(column(s) - tile.column_begin, s.row, packet_[0], in_packet++);
    if (in_packet < kPacket && n + 1 < subpixels_.size()) continue;
    trace_packet(scene, first_row, n + 1 - in_packet, n + 1, tracer);
    in_packet = 0;
  }
}

/// Traces a packet; inactive lanes repeat the first.
void SampledSubpixels::trace_packet(const Scene& scene, int first_row, size_t first, size_t end,
                                    PacketTracer& tracer) {
  for (size_t r = 0; r < kPacket; ++r) {
    const bool there = first + r < end;
    const Subpixel& s = subpixels_[there ? first + r : first];
    packet_[0].valid[r] = there ? -1 : 0;
    channel_[r] = s.at % 3;
    seeds_[r] = sampling::subpixel_seed(first_row + s.row, s.at, 0);
  }
  if (tracer.needs_seeds()) tracer.set_seeds(seeds_);
  tracer.trace_lanes(scene, plan_, channel_, packet_[0], light_);
  for (size_t n = first; n < end; ++n) subpixels_[n].light = light_[n - first];
}

}  // namespace lenticule::render
