// SPDX-License-Identifier: Apache-2.0
#include "lab/measures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "base/error.h"

namespace lenticule::lab {

Flicker FlickerMeter::add(const FrameView& reference, const FrameView& test) {
  require_same_size(reference, test);
  const bool first = before_.empty();
  if (!first) require_same_size({geometry_, {}}, test);
  geometry_ = test.geometry;
  before_.resize(test.bytes.size());
  uint64_t sum = 0;
  int largest = 0;
  for (size_t s = 0; s < before_.size(); ++s) {
    const int error = int{test.bytes[s]} - int{reference.bytes[s]};
    const int change = first ? 0 : std::abs(error - before_[s]);
    sum += static_cast<uint64_t>(change);
    largest = std::max(largest, change);
    before_[s] = static_cast<int16_t>(error);
  }
  const double samples = std::max(1.0, static_cast<double>(before_.size()));
  return {.mean = static_cast<double>(sum) / samples, .largest = largest};
}

namespace {

uint64_t squares_in(const FrameView& a, const FrameView& b, const Tile& tile) {
  uint64_t sum = 0;
  for (int j = tile.y; j < tile.y + tile.height; ++j)
    for (int s = 3 * tile.x; s < 3 * (tile.x + tile.width); ++s) {
      const int distance = int{a.row(j)[s]} - int{b.row(j)[s]};
      sum += static_cast<uint64_t>(distance * distance);
    }
  return sum;
}

std::vector<int> beginnings(int whole, int part) {
  std::vector<int> places;
  for (int place = 0; place < whole - part; place += std::max(1, part / 2)) places.push_back(place);
  places.push_back(whole - part);
  return places;
}

}  // namespace

std::vector<Tile> worst_tiles(const FrameView& reference, const FrameView& test, int side,
                              int count) {
  require_same_size(reference, test);
  if (side < 1)
    throw Error(ErrorKind::Usage, fmt::format("tiles of {} pixels: must have at least 1", side));
  if (reference.bytes.empty()) return {};
  Tile tile{.width = std::min(side, reference.geometry.width),
            .height = std::min(side, reference.geometry.height)};
  std::vector<Tile> left;
  for (const int y : beginnings(reference.geometry.height, tile.height))
    for (const int x : beginnings(reference.geometry.width, tile.width)) {
      tile.x = x;
      tile.y = y;
      tile.mse =
          static_cast<double>(squares_in(reference, test, tile)) / (3.0 * tile.width * tile.height);
      if (tile.mse > 0.0) left.push_back(tile);
    }
  std::vector<Tile> worst;
  while (static_cast<int>(worst.size()) < count && !left.empty()) {
    worst.push_back(*std::ranges::max_element(left, {}, &Tile::mse));
    std::erase_if(left, [&](const Tile& one) { return one.overlaps(worst.back()); });
  }
  return worst;
}

}  // namespace lenticule::lab
