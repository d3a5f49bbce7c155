// SPDX-License-Identifier: Apache-2.0
// BandOrder decides, step by step, which bands of a frame method adaptive tries and which it leaves
// to method full, from what the bands tried before have gained.
#pragma once

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
  /// more. All gains of a frame have the same unit.
  void note(int band, int64_t gain);
  /// Returns true if the bands tried so far have cost more than with method full. A single band is
  /// not enough evidence, nor are few bands of which some have gained.
  [[nodiscard]] bool loses() const { return tried_ >= (none_gained_ ? 2 : 4) && total_ < 0; }
  /// Returns true if a further cost of the bands tried so far uses up what they have gained. Four
  /// bands are the least evidence.
  [[nodiscard]] bool loses_after(int64_t further) const {
    return further > 0 && tried_ >= 4 && total_ < further;
  }

 private:
  [[nodiscard]] int64_t expected_gain(int band) const;

  std::vector<std::optional<int64_t>> gains_;  ///< gain of each band; empty until the band is tried
  std::vector<uint8_t> decided_;
  bool is_first_ = true;
  bool all_gained_ = true, none_gained_ = true;
  int stride_;
  int64_t total_ = 0;
  int64_t tried_ = 0;
};

}  // namespace lenticule::render
