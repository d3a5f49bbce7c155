// SPDX-License-Identifier: Apache-2.0
// ZoneMask marks the subpixels that no viewer sees and that need not be rendered.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "optics/zone/viewing_zone.h"
#include "render/rays/tile.h"

namespace lenticule::render {

/// ZoneMask holds a bit for each subpixel of a panel. Thread safety: immutable after construction,
/// usable from any thread.
class ZoneMask {
 public:
  /// Works with `threads` threads, 0 for all cores. Throws the errors of optics::ZoneVisibility.
  ZoneMask(const optics::OpticalModel& model, const optics::ViewingZone& zone, int threads);

  /// Returns true if some eye of the zone may see subpixel `at` (3 i + channel) of a row.
  [[nodiscard]] bool seen(int row, size_t at) const {
    return (words_of(row)[at / kBits] >> at % kBits & 1) == 0;
  }
  /// Returns true if no eye sees any subpixel of a tile's column.
  [[nodiscard]] bool hides(const TilePlan& plan, const Tile& tile, int column) const;
  /// Calls visit(at) for each subpixel from `first` to before `end` of a row that no eye sees.
  template <class Visit>
  void for_each_unseen(int row, size_t first, size_t end, const Visit& visit) const {
    for (size_t word = first / kBits; word * kBits < end; ++word)
      for (uint64_t left = words_of(row)[word]; left != 0; left &= left - 1) {
        const size_t at = word * kBits + static_cast<size_t>(std::countr_zero(left));
        if (at >= first && at < end) visit(at);
      }
  }
  /// Returns the number of subpixels of the panel and of a row that no eye sees.
  [[nodiscard]] uint64_t unseen() const;
  [[nodiscard]] uint32_t unseen_in(int row) const { return unseen_[static_cast<size_t>(row)]; }

 private:
  static constexpr size_t kBits = 64;

  [[nodiscard]] const uint64_t* words_of(int row) const {
    return words_.data() + static_cast<size_t>(row) * words_per_row_;
  }

  size_t words_per_row_;
  std::vector<uint64_t> words_;   ///< bits of unseen subpixels, row by row
  std::vector<uint32_t> unseen_;  ///< number of unseen subpixels in each row
};

}  // namespace lenticule::render
