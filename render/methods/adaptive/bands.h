// SPDX-License-Identifier: Apache-2.0
// BandOrder decides, step by step, which bands of a frame method adaptive tries and which it leaves
// to method full, from what the bands tried before have gained. BandCostModel estimates the gains.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace lenticule::render {

/// BandOrder serves one frame. The first step tries a few bands spread over the frame, the next
/// steps the bands halfway between those. A band is left to method full in two cases: the nearest
/// tried bands above and below it have each cost more than method full, or their gains and twice
/// the mean gain of all tried bands add up to a loss. Decisions depend on the noted gains only.
class BandOrder {
 public:
  explicit BandOrder(int bands);

  /// Returns the bands of the next step, in ascending order. The gains of all bands returned before
  /// must be noted. Returns none after the last step.
  [[nodiscard]] std::vector<int> next();
  /// Notes the processor time that a tried band has saved against method full, negative if it took
  /// more. A later gain replaces an earlier one. All gains of a frame have the same unit.
  void note(int band, int64_t gain);
  /// Returns true if the bands tried so far have cost more than with method full. A single band is
  /// not enough evidence, nor are few bands of which some have gained.
  [[nodiscard]] bool loses() const;

 private:
  /// The gains of all tried bands together.
  struct Sum {
    int64_t total = 0, tried = 0, gained = 0;
  };
  [[nodiscard]] Sum sum() const;
  [[nodiscard]] int64_t expected_gain(int band, const Sum& all) const;

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
