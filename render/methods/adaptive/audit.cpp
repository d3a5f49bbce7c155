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

/// Distance of the bands of the step after the first.
constexpr int kSecond = 8;
/// Returns the distance of the first bands: few, but two if possible.
int first_stride(int bands) {
  return bands >= 8 * kSecond ? 4 * kSecond : 2 * kSecond;
}

}  // namespace

BandOrder::BandOrder(int bands)
    : gains_(static_cast<size_t>(bands)), decided_(gains_.size()), stride_(first_stride(bands)) {}

std::vector<int> BandOrder::next() {
  std::vector<int> due;
  const Sum all = sum();
  while (due.empty() && stride_ > 0) {
    const int first = is_first_ ? stride_ / 2 : 0;
    for (int band = first; band < static_cast<int>(gains_.size()); band += stride_) {
      uint8_t& decided = decided_[static_cast<size_t>(band)];
      if (decided == 0 && expected_gain(band, all) >= 0) due.push_back(band);
      decided = 1;
    }
    if (is_first_)
      stride_ = kSecond;
    else
      stride_ = all.gained == all.tried && stride_ > 1 ? 1 : stride_ / 2;
    is_first_ = false;
  }
  return due;
}

void BandOrder::note(int band, int64_t gain) {
  LENTICULE_CHECK(decided_[static_cast<size_t>(band)] != 0);
  gains_[static_cast<size_t>(band)] = gain;
}

BandOrder::Sum BandOrder::sum() const {
  Sum all;
  for (const std::optional<int64_t>& gain : gains_) {
    if (!gain) continue;
    all.total += *gain;
    ++all.tried;
    all.gained += *gain >= 0 ? 1 : 0;
  }
  return all;
}

bool BandOrder::loses() const {
  const Sum all = sum();
  return all.tried >= (all.gained == 0 ? 2 : 4) && all.total < 0;
}

/// Estimates four times the gain of a band: those of its neighbours, and twice the mean, which does
/// not make up for two neighbours that lose.
int64_t BandOrder::expected_gain(int band, const Sum& all) const {
  if (all.tried == 0) return 0;
  const int64_t mean = all.total / all.tried;
  const auto nearest = [&](int way) {
    for (int n = band; n >= 0 && n < static_cast<int>(gains_.size()); n += way)
      if (gains_[static_cast<size_t>(n)]) return *gains_[static_cast<size_t>(n)];
    return mean;
  };
  const int64_t above = nearest(-1), below = nearest(1);
  if (above < 0 && below < 0) return above + below;
  return above + below + 2 * mean;
}

namespace {

// Rough estimates from profiles of a few scenes, in nanoseconds; not fitted.
constexpr int64_t kPrimary = 45;     ///< method full: a ray that meets a surface, and its shading
constexpr int64_t kMaterial = 60;    ///< the same with a metallic-roughness material, some textured
constexpr int64_t kRay = 20;         ///< a shadow or secondary ray
constexpr int64_t kSubpixel = 10;    ///< row sweep and lookup
constexpr int64_t kCut = 90;         ///< a primitive cut by a row's plane
constexpr int64_t kSorting = 60;     ///< a subpixel that is shaded individually, without its rays
constexpr int64_t kPrimitive = 400;  ///< set-up for a frame
/// Subpixels with metallic-roughness materials: three channels are kept for each sample, and as
/// long as shading itself takes the sorting of those that are shaded individually.
constexpr int64_t kMaterialSubpixel = 20;
constexpr int64_t kMaterialSorting = 90;
/// Rays per subpixel with soft light, in sixteenths: always many.
constexpr int64_t kSoftRays = 16 * 100;

/// Costs of metallic-roughness materials, with the time of `full` for a subpixel that sees one.
BandCosts costs_of_materials(const BandCounts& band, int64_t full) {
  const int64_t seen = band.seen, shaded = band.shaded;
  return {.full = seen * full,
          .lookups = seen * kMaterialSubpixel + band.cuts * kCut,
          .shading = shaded * (kMaterialSorting + full / 2)};
}

}  // namespace

BandCosts BandCostModel::costs(const BandCounts& band) const {
  const int64_t rendered = std::max<int64_t>(static_cast<int64_t>(subpixels), 1);
  const int64_t rays =
      is_soft ? kSoftRays
              : static_cast<int64_t>(16 * band.rays) / std::max<int64_t>(band.audited, 1);
  // Subpixels that see nothing cost little with both methods.
  const int64_t seen = band.seen, shaded = band.shaded;
  const int64_t rays_of_seen = seen > 0 ? rays * rendered / seen : 0;
  if (has_pbr) return costs_of_materials(band, kMaterial + kRay * rays_of_seen / 16);
  const int64_t full = kPrimary + kRay * rays_of_seen / 16;
  const int64_t samples = seen * full / 8 + band.audited * full * seen / rendered;
  return {.full = seen * full,
          .lookups = seen * kSubpixel + band.cuts * kCut + samples,
          .shading = shaded * (kSorting + full * 5 / 8)};
}

int64_t time_of_full(int64_t subpixels, int64_t rays) {
  return subpixels * (kPrimary + kRay * rays / 16);
}

int64_t time_of_set_up(int64_t primitives) {
  return primitives * kPrimitive;
}

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
