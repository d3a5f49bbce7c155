// SPDX-License-Identifier: Apache-2.0
// Audit of method adaptive: a fixed random selection of subpixels is traced in addition, to measure
// the error of a frame and to find the bands that must be retraced.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "base/error.h"
#include "render/integrator/packet_tracer.h"
#include "render/rays/primary_packets.h"
#include "render/rays/primary_rays.h"

namespace lenticule::render {

// BandOrder decides, step by step, which bands of a frame method adaptive tries and which it leaves
// to method full, from what the bands tried before have gained. BandCostModel estimates the gains.

/// BandOrder serves one frame. The first step tries at least four bands spread over the frame,
/// since edges of surfaces may cross two, the next steps the bands halfway between those. A band is
/// left to method full in two cases: the nearest tried bands above and below it have each cost more
/// than method full, or their gains and twice the mean gain of all tried bands add up to a loss.
/// Decisions depend on the noted gains only.
class BandOrder {
 public:
  explicit BandOrder(int bands)
      : gains_(static_cast<size_t>(bands)), decided_(gains_.size()), stride_(first_stride(bands)) {}

  /// Returns the bands of the next step, in ascending order. The gains of all bands returned before
  /// must be noted. Returns none after the last step.
  [[nodiscard]] std::vector<int> next() {
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
        stride_ = std::min(stride_, kSecond);
      else
        stride_ = all.gained == all.tried && stride_ > 1 ? 1 : stride_ / 2;
      is_first_ = false;
    }
    return due;
  }
  /// Notes the processor time that a tried band has saved against method full, negative if it took
  /// more. A later gain replaces an earlier one. All gains of a frame have the same unit.
  void note(int band, int64_t gain) {
    LENTICULE_CHECK(decided_[static_cast<size_t>(band)] != 0);
    gains_[static_cast<size_t>(band)] = gain;
  }
  /// Returns true if the bands tried so far have cost more than with method full. Few bands are not
  /// enough evidence.
  [[nodiscard]] bool loses() const {
    const Sum all = sum();
    return all.tried >= kFewest && all.total < 0;
  }

 private:
  /// Distance of the bands of the step after the first.
  static constexpr int kSecond = 8;
  /// Number of bands of the first step, if the frame has twice as many, or more.
  static constexpr int kFewest = 4;

  static int first_stride(int bands) {
    int stride = 4 * kSecond;
    while (stride > 2 && bands < kFewest * stride) stride /= 2;
    return stride;
  }
  /// The gains of all tried bands together.
  struct Sum {
    int64_t total = 0, tried = 0, gained = 0;
  };
  [[nodiscard]] Sum sum() const {
    Sum all;
    for (const std::optional<int64_t>& gain : gains_) {
      if (!gain) continue;
      all.total += *gain;
      ++all.tried;
      all.gained += *gain >= 0 ? 1 : 0;
    }
    return all;
  }
  /// Estimates four times the gain of a band: those of its neighbours, and twice the mean, which
  /// does not make up for two neighbours that lose.
  [[nodiscard]] int64_t expected_gain(int band, const Sum& all) const {
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

  std::vector<std::optional<int64_t>> gains_;  ///< gain of each band; empty until the band is tried
  std::vector<uint8_t> decided_;
  bool is_first_ = true;
  int stride_;
};

/// BandCounts holds what the costs of a band depend on.
struct BandCounts {
  uint32_t seen = 0;     ///< subpixels that see a surface
  uint32_t shaded = 0;   ///< subpixels that were shaded individually, or copied instead
  uint32_t cuts = 0;     ///< primitives cut by the rows' planes
  uint32_t audited = 0;  ///< subpixels traced for the audit
  uint64_t rays = 0;     ///< shadow and secondary rays of these
};

/// BandCosts holds estimates in nanoseconds of processor time. Only their ratios matter.
struct BandCosts {
  int64_t full = 0;     ///< cost with method full
  int64_t lookups = 0;  ///< sweep, lookups, samples and audit of method adaptive
  int64_t shading = 0;  ///< subpixels that method adaptive shades individually

  [[nodiscard]] int64_t spent() const { return lookups + shading; }
};

// Rough estimates from profiles of a few scenes, in nanoseconds; not fitted.
inline constexpr int64_t kPrimary =
    45;  ///< method full: a ray that meets a surface, and its shading
inline constexpr int64_t kMaterial =
    60;                              ///< the same with a metallic-roughness material, some textured
inline constexpr int64_t kRay = 20;  ///< a shadow or secondary ray
inline constexpr int64_t kSubpixel = 10;  ///< row sweep and lookup
inline constexpr int64_t kCut = 90;       ///< a primitive cut by a row's plane
inline constexpr int64_t kSorting =
    60;  ///< a subpixel that is shaded individually, without its rays
/// Subpixels with metallic-roughness materials: three channels are kept for each sample, and as
/// long as shading itself takes the sorting of those that are shaded individually.
inline constexpr int64_t kMaterialSubpixel = 20;
inline constexpr int64_t kMaterialSorting = 90;
/// Finding the surfaces and rows of a primitive, once a frame.
inline constexpr int64_t kPrimitive = 400;
/// Rays per subpixel with soft light, in sixteenths: always many.
inline constexpr int64_t kSoftRays = 16 * 100;

/// BandCostModel estimates the costs of the bands of one scene.
struct BandCostModel {
  size_t subpixels = 0;  ///< number of subpixels of a band
  bool has_pbr = false;  ///< the scene has metallic-roughness materials
  bool is_soft = false;  ///< light is sampled: each subpixel has many rays

  [[nodiscard]] BandCosts costs(const BandCounts& band) const {
    const int64_t rendered = std::max<int64_t>(static_cast<int64_t>(subpixels), 1);
    const int64_t rays =
        is_soft ? kSoftRays
                : static_cast<int64_t>(16 * band.rays) / std::max<int64_t>(band.audited, 1);
    // Subpixels that see nothing cost little with both methods.
    const int64_t seen = band.seen, shaded = band.shaded;
    const int64_t rays_of_seen = seen > 0 ? rays * rendered / seen : 0;
    const int64_t full = (has_pbr ? kMaterial : kPrimary) + kRay * rays_of_seen / 16;
    if (has_pbr)
      return {.full = seen * full,
              .lookups = seen * kMaterialSubpixel + band.cuts * kCut,
              .shading = shaded * (kMaterialSorting + full / 2)};
    const int64_t samples = seen * full / 8 + band.audited * full * seen / rendered;
    return {.full = seen * full,
            .lookups = seen * kSubpixel + band.cuts * kCut + samples,
            .shading = shaded * (kSorting + full * 5 / 8)};
  }
};

/// Two disjoint selections: one decides which bands are retraced, the other evaluates the result.
enum class Draw : uint8_t { None, Retracing, Evaluation };

/// Each of the two selections has one subpixel per kSampledOneIn subpixels of a row (stratified,
/// fixed positions), or more if AuditSelection is told so. Stratification covers a frame more
/// evenly than a binomial sample, so the binomial bounds below are conservative.
inline constexpr uint32_t kSampledOneIn = 512;
struct SampledPair {
  uint32_t retracing, evaluation;  ///< subpixels of the row, or beyond its end
};

/// AuditSelection selects subpixels by a hash of their place. A denser evaluation proves more.
class AuditSelection {
 public:
  /// The evaluation takes one in `one_in` subpixels, 2 to kSampledOneIn. The other selection takes
  /// about one in `retracing_one_in`, `one_in` to kSampledOneIn.
  explicit AuditSelection(uint32_t one_in = kSampledOneIn,
                          uint32_t retracing_one_in = kSampledOneIn)
      : one_in_(one_in), retracing_every_(retracing_one_in / one_in) {}

  [[nodiscard]] uint32_t one_in() const { return one_in_; }
  /// Returns the selected subpixels among the one_in() subpixels that start at one_in() *
  /// `stretch`.
  [[nodiscard]] SampledPair pair(uint32_t row, uint32_t stretch) const {
    uint32_t hash = (row * 0x9e3779b9U) ^ (stretch * 0x85ebca6bU);
    hash ^= hash >> 15;
    hash *= 0x2c1b3c6dU;
    hash ^= hash >> 12;
    hash *= 0x297a2d39U;
    hash ^= hash >> 15;
    const uint32_t first = stretch * one_in_;
    const uint32_t retracing = hash % one_in_;
    const uint32_t apart = 1 + (hash >> 16) % (one_in_ - 1);
    return {stretch % retracing_every_ == 0 ? first + retracing : kNone,
            first + (retracing + apart) % one_in_};
  }

 private:
  static constexpr uint32_t kNone = UINT32_MAX;

  uint32_t one_in_, retracing_every_;
};

struct AuditCounts {
  uint64_t sampled = 0;
  uint64_t beyond = 0;  ///< part of `sampled` whose error exceeds the tolerated error
};

/// Returns the probability of at most `successes` in `tries`, each with probability p in (0, 1).
inline double cumulative_binomial(uint64_t successes, uint64_t tries, double p) {
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

/// Number of sets of bands whose mean square may be judged by one evaluation, each with fewer
/// errors than the one before.
inline constexpr int kMeanSquareLooks = 6;

/// Returns an upper bound, with 99.99 % confidence, of the share of all subpixels whose error
/// exceeds the tolerated error (Clopper and Pearson's exact bound for a binomial share); 1 if no
/// subpixel was sampled. The confidence is that high because the bounds of all frames of a sequence
/// should hold, and because the selection is the same in each. It is that of the looks 0 to
/// kMeanSquareLooks - 1 together, of which the last one taken depends on the samples: their doubts
/// add up. The first look has nearly all of it, since most frames take no other.
[[nodiscard]] inline double bound_of_share(const AuditCounts& counts, int look = 0) {
  constexpr double kLater = 0.000001;
  const double doubt = look == 0 ? 0.0001 - (kMeanSquareLooks - 1) * kLater : kLater;
  if (counts.sampled == 0 || counts.beyond >= counts.sampled) return 1.0;
  double low = 0.0, high = 1.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (low + high);
    (cumulative_binomial(counts.beyond, counts.sampled, middle) > doubt ? low : high) = middle;
  }
  return high;
}

/// Returns true if the samples of a band indicate that more than the share `most` of its subpixels
/// exceeds the tolerated error.
[[nodiscard]] inline bool needs_retracing(const AuditCounts& band, double most) {
  // Three standard deviations above the count that such a share would give by chance.
  const double expected = most * static_cast<double>(band.sampled);
  return static_cast<double>(band.beyond) > expected + 3.0 * std::sqrt(expected) + 1.0;
}

/// Errors of sampled subpixels: how many are off by 0, 1, ..., 255 code values.
class AuditErrors {
 public:
  void add(uint8_t code, uint8_t exact) {
    ++subpixels_[static_cast<size_t>(std::abs(int{code} - int{exact}))];
  }
  /// Adds samples without error.
  void add_exact(uint64_t samples) { subpixels_[0] += static_cast<uint32_t>(samples); }
  AuditErrors& operator+=(const AuditErrors& other) {
    for (size_t error = 0; error < subpixels_.size(); ++error)
      subpixels_[error] += other.subpixels_[error];
    return *this;
  }

  [[nodiscard]] uint64_t sampled() const { return at_least(0); }
  /// Returns the number of errors of `error` code values, 0 to 255.
  [[nodiscard]] uint64_t exactly(int error) const { return subpixels_[static_cast<size_t>(error)]; }
  /// Returns the number of errors of at least `error` code values, 0 to 256.
  [[nodiscard]] uint64_t at_least(int error) const {
    return std::accumulate(subpixels_.begin() + error, subpixels_.end(), uint64_t{0});
  }
  /// Returns the number of errors that exceed the tolerated error.
  [[nodiscard]] AuditCounts counts(double tolerated_error) const {
    const double first = std::floor(std::min(tolerated_error, 255.0)) + 1.0;
    return {.sampled = sampled(), .beyond = at_least(static_cast<int>(first))};
  }
  /// Returns the mean of the squared errors; 0 if there are none.
  [[nodiscard]] double mean_square() const {
    double sum = 0.0;
    for (size_t error = 1; error < subpixels_.size(); ++error)
      sum += static_cast<double>(error * error) * subpixels_[error];
    return sum / static_cast<double>(std::max<uint64_t>(sampled(), 1));
  }
  /// Returns the standard error of mean_square(); 0 for fewer than two samples.
  [[nodiscard]] double standard_error() const {
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

 private:
  std::array<uint32_t, 256> subpixels_{};
};

/// Largest squared error, rounded up so that no factor of bound_of_mean_square() is 0.
inline constexpr double kLargestSquare = 256.0 * 256.0;
/// Probability that the bound of a mean square is too low, and that of look `look`. Most frames are
/// good at the first look.
inline constexpr double kSquareDoubt = 0.01;
constexpr double doubt_of_look(int look) {
  constexpr double kFirstLook = 0.75;
  return kSquareDoubt * (look == 0 ? kFirstLook : (1.0 - kFirstLook) / (kMeanSquareLooks - 1));
}
/// Part of it that is spent on the first factor, which is the best one unless errors are very
/// large.
inline constexpr double kFirstPart = 0.9;

/// Returns an upper bound of the mean squared error of all subpixels: that of the samples, and what
/// errors of 255 code values may add that no sample shows. With 99 % confidence, none of the bounds
/// of the looks 0 to kMeanSquareLooks - 1 at one frame is too low.
/// With x = error^2 / kLargestSquare and 0 < f <= 1, the expected product of 1 - f x over all
/// samples is at most exp(-f n m), where n m is the sum of the expected x of the samples. So by
/// Markov's inequality the product exceeds exp(-f n m) / doubt with at most the probability
/// `doubt`, for samples from any errors. The smallest of the bounds with a few f holds if their
/// doubts add up.
[[nodiscard]] inline double bound_of_mean_square(const AuditErrors& errors, int look = 0) {
  constexpr std::array kFactors = {1.0, 0.5, 0.25, 0.125};
  const auto sampled = static_cast<double>(errors.sampled());
  double least = 255.0 * 255.0;
  for (size_t n = 0; n < kFactors.size(); ++n) {
    const double part = n == 0 ? kFirstPart : (1.0 - kFirstPart) / (kFactors.size() - 1.0);
    double sum = -std::log(part * doubt_of_look(look));
    for (int error = 1; error < 256; ++error)
      sum -= static_cast<double>(errors.exactly(error)) *
             std::log1p(-kFactors[n] * error * error / kLargestSquare);
    least = std::min(least, kLargestSquare * sum / (kFactors[n] * sampled));
  }
  return least;
}

/// Returns one in how many subpixels the evaluation must select so that the bound of a frame
/// without errors is about half of `mean_square`: 2 to kSampledOneIn.
[[nodiscard]] inline uint32_t sampled_one_in_for(double mean_square, uint64_t subpixels) {
  constexpr double kParts = 2.0;  // one of them is spent on errors that no sample shows
  const double samples =
      kParts * kLargestSquare / mean_square * -std::log(kFirstPart * doubt_of_look(0));
  const double one_in = static_cast<double>(subpixels) / samples;
  return static_cast<uint32_t>(std::clamp(one_in, 2.0, double{kSampledOneIn}));
}

/// SampledSubpixel is a subpixel that the audit samples.
struct SampledSubpixel {
  int32_t at = 0;    ///< 3 i + channel
  uint16_t row = 0;  ///< index in the band
  Draw draw = Draw::None;
  float light = 0.0F;  ///< result of tracing
};

/// SampledTracer traces sampled subpixels as method full does. It belongs to one thread. A ray that
/// differs in its last bit can give a different picture after several reflections. So rays are the
/// same as in method full, and the light of a ray does not depend on the other rays of its packet.
class SampledTracer {
 public:
  /// Lifetime: all arguments must outlive the object. `centre` is the centre of the subpixels.
  SampledTracer(const PrimaryPackets& packets, const TilePlan& plan, const Footprint& centre)
      : plan_(plan), centre_(centre), maker_(packets) {
    init_packets({&packet_, 1});
  }

  /// Sorts the subpixels of a band for trace().
  void sort(std::span<SampledSubpixel> subpixels) const {
    std::ranges::sort(subpixels, {},
                      [&](const SampledSubpixel& s) { return std::pair(column(s), s.row); });
  }
  /// Traces sorted subpixels of the band that begins at `first_row`, in packets from the first one
  /// on. The calling thread must flush denormals.
  void trace(const Scene& scene, int first_row, std::span<SampledSubpixel> subpixels,
             PacketTracer& tracer) {
    const int first_tile = first_row / TilePlan::kRows * plan_.per_band();
    int tiles_begun = 0;
    Tile tile{};
    size_t in_packet = 0;
    for (size_t n = 0; n < subpixels.size(); ++n) {
      const SampledSubpixel& s = subpixels[n];
      while (tiles_begun == 0 || column(s) >= tile.column_begin + tile.columns) {
        LENTICULE_CHECK(tiles_begun < plan_.per_band());
        tile = plan_.tile(first_tile + tiles_begun++);
        if (column(s) < tile.column_begin + tile.columns) maker_.start_few(scene, tile, centre_);
      }
      maker_.ray(column(s) - tile.column_begin, s.row, packet_, in_packet++);
      if (in_packet < kPacket && n + 1 < subpixels.size()) continue;
      trace_packet(scene, first_row, subpixels.subspan(n + 1 - in_packet, in_packet), tracer);
      in_packet = 0;
    }
  }

 private:
  [[nodiscard]] int column(const SampledSubpixel& s) const { return s.at + plan_.shift(s.row); }
  /// Traces a packet; inactive lanes repeat the first.
  void trace_packet(const Scene& scene, int first_row, std::span<SampledSubpixel> subpixels,
                    PacketTracer& tracer) {
    for (size_t r = 0; r < kPacket; ++r) {
      const bool there = r < subpixels.size();
      const SampledSubpixel& s = subpixels[there ? r : 0];
      packet_.valid[r] = there ? -1 : 0;
      channel_[r] = s.at % 3;
      seeds_[r] = sampling::subpixel_seed(first_row + s.row, s.at, 0);
    }
    if (tracer.needs_seeds()) tracer.set_seeds(seeds_);
    tracer.trace_lanes(scene, plan_, channel_, packet_, light_);
    for (size_t n = 0; n < subpixels.size(); ++n) subpixels[n].light = light_[n];
  }

  const TilePlan& plan_;
  const Footprint& centre_;
  PrimaryPackets::Maker maker_;
  RayPacket packet_{};
  alignas(64) std::array<int32_t, kPacket> channel_{};
  std::array<uint32_t, kPacket> seeds_{};
  alignas(64) std::array<float, kPacket> light_{};
};

}  // namespace lenticule::render
