// SPDX-License-Identifier: Apache-2.0
// Lists the panels that several connectors feed, with the place of each connector, for `doctor`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "display/kms/inspect.h"

namespace lenticule::display {

/// PlacedTile is one place of a tiled panel.
struct PlacedTile {
  int column = 0;
  int row = 0;
  std::string connector{};  ///< connector with a panel there; empty if no cable leads there
};

/// TileGroup is a panel of several tiles, as the connected ones describe it.
struct TileGroup {
  std::string card;    ///< path of the card's node
  uint32_t group = 0;  ///< the kernel's number
  int columns = 1, rows = 1;
  int width = 0, height = 0;        ///< pixels of the whole panel
  std::vector<PlacedTile> tiles{};  ///< every place, in rows from the top left

  /// Returns true if every tile is connected.
  [[nodiscard]] bool complete() const;
};

/// Returns the groups of the panels, in the order of their first connectors. Disconnected
/// connectors and those whose tile is not known are left out.
[[nodiscard]] std::vector<TileGroup> tile_groups(const std::vector<PanelInfo>& panels);

}  // namespace lenticule::display
