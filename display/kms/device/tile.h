// SPDX-License-Identifier: Apache-2.0
// Tile is the place of one connector's picture in a panel that two or more connectors feed, as 5K
// and 8K panels with two cables have. The kernel reads it from DisplayID and states it in the
// connector's property TILE.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace lenticule::display {

struct Tile {
  uint32_t group = 0;  ///< the same for all tiles of a panel
  /// True if the tiles are one panel in one housing.
  bool single_monitor = false;
  int columns = 1, rows = 1;  ///< size of the panel in tiles
  int column = 0, row = 0;
  int width = 0, height = 0;  ///< pixels of a tile

  [[nodiscard]] int count() const { return columns * rows; }
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// Parses "group:single:columns:rows:column:row:width:height", the kernel's text, with or without a
/// zero at its end. Returns none for any other text and for impossible numbers.
[[nodiscard]] std::optional<Tile> parse_tile(std::span<const uint8_t> blob);

}  // namespace lenticule::display
