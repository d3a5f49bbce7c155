// SPDX-License-Identifier: Apache-2.0
// Audit of method adaptive: a fixed random selection of subpixels is traced in addition, to measure
// the error of a frame and to find the bands that must be retraced.
#pragma once

#include <cstdint>

namespace lenticule::render {

/// Two disjoint selections: one decides which bands are retraced (Mending), the other evaluates the
/// result (Judging).
enum class Draw : uint8_t { None, Retracing, Evaluation };

/// Each of the two selections has one subpixel per kSampledOneIn subpixels of a row (stratified,
/// fixed positions). Stratification covers a frame more evenly than a binomial sample, so the
/// binomial bound below is conservative.
inline constexpr uint32_t kSampledOneIn = 512;
struct SampledPair {
  uint32_t retracing, evaluation;  ///< subpixels of the row; the last one may lie beyond its end
};
/// Returns the selected subpixels among the kSampledOneIn subpixels that start at kSampledOneIn *
/// `stretch`.
[[nodiscard]] inline SampledPair sampled_pair(uint32_t row, uint32_t stretch) {
  uint32_t hash = (row * 0x9e3779b9U) ^ (stretch * 0x85ebca6bU);
  hash ^= hash >> 15;
  hash *= 0x2c1b3c6dU;
  hash ^= hash >> 12;
  hash *= 0x297a2d39U;
  hash ^= hash >> 15;
  const uint32_t first = stretch * kSampledOneIn;
  const uint32_t retracing = hash % kSampledOneIn;
  const uint32_t apart = 1 + (hash >> 16) % (kSampledOneIn - 1);
  return {first + retracing, first + (retracing + apart) % kSampledOneIn};
}

struct AuditCounts {
  uint64_t sampled = 0;
  uint64_t beyond = 0;  ///< the error exceeds the tolerated error
  AuditCounts& operator+=(const AuditCounts& other) {
    sampled += other.sampled;
    beyond += other.beyond;
    return *this;
  }
};

/// Returns an upper bound, with 99.99 % confidence, of the share of all subpixels whose error
/// exceeds the tolerated error (Clopper and Pearson's exact bound for a binomial share); 1 if no
/// subpixel was sampled. The confidence is that high because the bounds of all frames of a sequence
/// should hold, and because the selection is the same in each.
[[nodiscard]] double bound_of_share(const AuditCounts& counts);

/// Returns true if the samples of a band indicate that more than the share `most` of its subpixels
/// exceeds the tolerated error.
[[nodiscard]] bool needs_retracing(const AuditCounts& band, double most);

}  // namespace lenticule::render
