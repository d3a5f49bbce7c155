// SPDX-License-Identifier: Apache-2.0
// Estimated costs of a band of rows, with method full and with method adaptive. They come from
// counters, never from a clock, so that the bytes of a frame are the same on every machine.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lenticule::render {

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

/// BandCostModel estimates the costs of the bands of one scene.
struct BandCostModel {
  size_t subpixels = 0;  ///< number of subpixels of a band
  bool has_pbr = false;  ///< the scene has metallic-roughness materials
  bool is_soft = false;  ///< light is sampled: each subpixel has many rays

  [[nodiscard]] BandCosts costs(const BandCounts& band) const;
};

/// Returns the estimated time of method full for subpixels that all see a surface and from each of
/// which `rays` sixteenths of a ray start.
[[nodiscard]] int64_t time_of_full(int64_t subpixels, int64_t rays);
/// Returns the estimated time that finding surfaces and rows of primitives takes in a frame.
[[nodiscard]] int64_t time_of_set_up(int64_t primitives);

}  // namespace lenticule::render
