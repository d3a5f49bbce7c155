// SPDX-License-Identifier: Apache-2.0
#include "lab/measures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "frames/compare.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/row_rays.h"

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

/// Enough bands for any number of threads, but few enough for long runs of rows.
constexpr int kBands = 64;

struct Rows {
  int begin;
  int end;
};

Rows rows_of(int band, int height) {
  const auto border = [height](int b) { return static_cast<int>(int64_t{height} * b / kBands); };
  return {border(band), border(band + 1)};
}

}  // namespace

ViewMap::ViewMap(const optics::OpticalModel& model, int views, BandWorkers& workers)
    : geometry_{model.rig().panel.width_px, model.rig().panel.height_px, frames::PixelFormat::Rgb8},
      views_(views),
      view_(geometry_.frame_bytes()) {
  if (views < 1 || views > frames::kMaxViews)
    throw Error(ErrorKind::Usage,
                fmt::format("{} views: not in 1 ... {}", views, frames::kMaxViews));
  const optics::RowRayEvaluator evaluator(model);
  std::vector<optics::RowRays> rays(static_cast<size_t>(workers.count()));
  workers.run(kBands, [&](int band, int worker) {
    optics::RowRays& row = rays[static_cast<size_t>(worker)];
    const Rows rows = rows_of(band, geometry_.height);
    for (int j = rows.begin; j < rows.end; ++j) {
      evaluator.evaluate(j, 0, geometry_.width, row);
      uint16_t* const out = view_.data() + static_cast<size_t>(j) * geometry_.row_bytes();
      for (size_t s = 0; s < row.size(); ++s)
        out[s] = static_cast<uint16_t>(
            frames::nearest_view(optics::view_number(row.place[s], views), views));
    }
  });
}

std::vector<Difference> ViewMap::compare(const FrameView& reference, const FrameView& test,
                                         BandWorkers& workers) const {
  require_same_size(reference, test);
  require_same_size({geometry_, {}}, test);
  const auto views = static_cast<size_t>(views_);
  std::vector<std::vector<Difference>> found(static_cast<size_t>(workers.count()),
                                             std::vector<Difference>(views));
  workers.run(kBands, [&](int band, int worker) {
    std::vector<Difference>& differences = found[static_cast<size_t>(worker)];
    const Rows rows = rows_of(band, geometry_.height);
    const size_t begin = static_cast<size_t>(rows.begin) * geometry_.row_bytes();
    const size_t end = static_cast<size_t>(rows.end) * geometry_.row_bytes();
    for (size_t s = begin; s < end; ++s)
      differences[view_[s]].add(reference.bytes[s], test.bytes[s]);
  });
  for (size_t worker = 1; worker < found.size(); ++worker)
    for (size_t view = 0; view < views; ++view) found[0][view].add(found[worker][view]);
  return std::move(found[0]);
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
