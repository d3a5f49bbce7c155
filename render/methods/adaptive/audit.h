// SPDX-License-Identifier: Apache-2.0
// Subpixels drawn at random are traced whatever samples say of them: that tells how far a frame is
// off, and where it has to be mended.
#pragma once

#include <cstdint>

namespace lenticule::render {

/// Two draws that share no subpixel: one decides what is mended, the other judges what came of it.
enum class Draw : uint8_t { None, Mending, Judging };

/// Of every kDrawnOneIn subpixels of a row each draw has one, always the same. That covers a frame
/// more evenly than a binomial draw would: what is said of that holds all the more.
inline constexpr uint32_t kDrawnOneIn = 512;
struct DrawnPair {
  uint32_t mending, judging;  ///< subpixels of the row; the last may lie beyond its end
};
/// Of subpixels kDrawnOneIn * `stretch` and those after it.
[[nodiscard]] inline DrawnPair drawn_of(uint32_t row, uint32_t stretch) {
  uint32_t hash = (row * 0x9e3779b9U) ^ (stretch * 0x85ebca6bU);
  hash ^= hash >> 15;
  hash *= 0x2c1b3c6dU;
  hash ^= hash >> 12;
  hash *= 0x297a2d39U;
  hash ^= hash >> 15;
  const uint32_t first = stretch * kDrawnOneIn;
  const uint32_t mending = hash % kDrawnOneIn;
  const uint32_t apart = 1 + (hash >> 16) % (kDrawnOneIn - 1);
  return {first + mending, first + (mending + apart) % kDrawnOneIn};
}

struct AuditCounts {
  uint64_t drawn = 0;
  uint64_t beyond = 0;  ///< off by more than the tolerated error
  AuditCounts& operator+=(const AuditCounts& other) {
    drawn += other.drawn;
    beyond += other.beyond;
    return *this;
  }
};

/// The share of all subpixels that are beyond is below this with 99 % confidence (Clopper and
/// Pearson's exact bound for a binomial share); 1 if none was drawn.
[[nodiscard]] double bound_of_share(const AuditCounts& counts);

/// Whether what was drawn of a band speaks for more than `most` of its subpixels being beyond.
[[nodiscard]] bool needs_mending(const AuditCounts& band, double most);

}  // namespace lenticule::render
