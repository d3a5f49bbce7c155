// SPDX-License-Identifier: Apache-2.0
#include "display/kms/tile_groups.h"

#include <algorithm>

namespace lenticule::display {
namespace {

/// Returns the group of a card's panel with all places empty.
TileGroup empty_group(const std::string& card, const Tile& tile) {
  TileGroup group{.card = card,
                  .group = tile.group,
                  .columns = tile.columns,
                  .rows = tile.rows,
                  .width = tile.columns * tile.width,
                  .height = tile.rows * tile.height};
  for (int place = 0; place < tile.count(); ++place)
    group.tiles.push_back({.column = place % tile.columns, .row = place / tile.columns});
  return group;
}

bool belongs_to(const TileGroup& group, const std::string& card, const Tile& tile) {
  return group.card == card && group.group == tile.group && group.columns == tile.columns &&
         group.rows == tile.rows;
}

}  // namespace

bool TileGroup::complete() const {
  return std::ranges::none_of(tiles, [](const PlacedTile& tile) { return tile.connector.empty(); });
}

std::vector<TileGroup> tile_groups(const std::vector<PanelInfo>& panels) {
  std::vector<TileGroup> groups;
  for (const PanelInfo& panel : panels) {
    if (!panel.connected || !panel.tile) continue;
    const Tile& tile = *panel.tile;
    auto group = std::ranges::find_if(
        groups, [&](const TileGroup& known) { return belongs_to(known, panel.card, tile); });
    if (group == groups.end()) group = groups.insert(group, empty_group(panel.card, tile));
    PlacedTile& place = group->tiles[static_cast<size_t>(tile.row * tile.columns + tile.column)];
    if (place.connector.empty()) place.connector = panel.connector;
  }
  return groups;
}

}  // namespace lenticule::display
