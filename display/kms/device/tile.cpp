// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/tile.h"

#include <string_view>

#include "base/numbers.h"

namespace lenticule::display {
namespace {

/// Most tiles along a side, and most pixels: DisplayID has no larger numbers.
constexpr uint32_t kMostTiles = 64;
constexpr uint32_t kMostPixels = 65536;

}  // namespace

std::optional<Tile> parse_tile(std::span<const uint8_t> blob) {
  std::string_view text(reinterpret_cast<const char*>(blob.data()), blob.size());
  if (text.ends_with('\0')) text.remove_suffix(1);
  const auto numbers = numbers_from<uint32_t, 8>(text, ':');
  if (!numbers) return std::nullopt;
  const auto [group, single, columns, rows, column, row, width, height] = *numbers;
  const bool possible = columns >= 1 && columns <= kMostTiles && rows >= 1 && rows <= kMostTiles &&
                        column < columns && row < rows && width >= 1 && width <= kMostPixels &&
                        height >= 1 && height <= kMostPixels;
  if (!possible) return std::nullopt;
  return Tile{.group = group,
              .single_monitor = single != 0,
              .columns = static_cast<int>(columns),
              .rows = static_cast<int>(rows),
              .column = static_cast<int>(column),
              .row = static_cast<int>(row),
              .width = static_cast<int>(width),
              .height = static_cast<int>(height)};
}

}  // namespace lenticule::display
