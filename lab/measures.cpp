// SPDX-License-Identifier: Apache-2.0
#include "lab/measures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "frames/compare.h"

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

constexpr int kStep = 8;

/// SquareSums is a summed-area table of squared differences: the sum above and to the left of each
/// pixel corner.
class SquareSums {
 public:
  SquareSums(const FrameView& a, const FrameView& b)
      : stride_(static_cast<size_t>(a.geometry.width) + 1),
        sums_(stride_ * (static_cast<size_t>(a.geometry.height) + 1)) {
    for (int j = 0; j < a.geometry.height; ++j) {
      const uint64_t* const above = sums_.data() + static_cast<size_t>(j) * stride_;
      uint64_t* const here = sums_.data() + static_cast<size_t>(j + 1) * stride_;
      uint64_t row = 0;
      for (int i = 0; i < a.geometry.width; ++i) {
        row += squares(a.row(j) + 3 * i, b.row(j) + 3 * i);
        here[i + 1] = above[i + 1] + row;
      }
    }
  }

  [[nodiscard]] uint64_t of(const Tile& tile) const {
    const auto at = [this](int x, int y) {
      return sums_[static_cast<size_t>(y) * stride_ + static_cast<size_t>(x)];
    };
    const int right = tile.x + tile.width;
    const int bottom = tile.y + tile.height;
    return at(right, bottom) - at(tile.x, bottom) - at(right, tile.y) + at(tile.x, tile.y);
  }

 private:
  static uint64_t squares(const uint8_t* a, const uint8_t* b) {
    uint64_t sum = 0;
    for (int c = 0; c < 3; ++c) {
      const int distance = int{a[c]} - int{b[c]};
      sum += static_cast<uint64_t>(distance * distance);
    }
    return sum;
  }

  size_t stride_;
  std::vector<uint64_t> sums_;
};

std::vector<int> beginnings(int whole, int part) {
  std::vector<int> places;
  for (int place = 0; place < whole - part; place += kStep) places.push_back(place);
  places.push_back(whole - part);
  return places;
}

struct Candidate {
  Tile tile;
  uint64_t squares;
};

std::vector<Candidate> candidates(const SquareSums& sums, const FrameGeometry& geometry, int side) {
  Tile tile{.width = std::min(side, geometry.width), .height = std::min(side, geometry.height)};
  const double samples = 3.0 * tile.width * tile.height;
  std::vector<Candidate> found;
  for (const int y : beginnings(geometry.height, tile.height))
    for (const int x : beginnings(geometry.width, tile.width)) {
      tile.x = x;
      tile.y = y;
      const uint64_t squares = sums.of(tile);
      if (squares == 0) continue;
      tile.mse = static_cast<double>(squares) / samples;
      found.push_back({tile, squares});
    }
  return found;
}

}  // namespace

std::vector<Tile> worst_tiles(const FrameView& reference, const FrameView& test, int side,
                              int count) {
  require_same_size(reference, test);
  if (side < 1)
    throw Error(ErrorKind::Usage, fmt::format("tiles of {} pixels: must have at least 1", side));
  if (reference.bytes.empty()) return {};
  std::vector<Candidate> left = candidates(SquareSums(reference, test), reference.geometry, side);
  std::vector<Tile> worst;
  while (static_cast<int>(worst.size()) < count && !left.empty()) {
    const auto next = std::max_element(
        left.begin(), left.end(),
        [](const Candidate& a, const Candidate& b) { return a.squares < b.squares; });
    worst.push_back(next->tile);
    std::erase_if(left, [&](const Candidate& one) { return one.tile.overlaps(worst.back()); });
  }
  return worst;
}

}  // namespace lenticule::lab
