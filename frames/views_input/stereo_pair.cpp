// SPDX-License-Identifier: Apache-2.0
// The two halves of a stereo pair show one scene from two places: almost every detail of one half
// is also in the other, in the same row, moved sideways by a few percent that depend on its
// distance. Nothing else looks so, if four things are asked for:
//
//  1. Detail is compared, not brightness. Each half is reduced to 256 columns, of which only the
//     changes from column to column count: skies, shadows, lines of text and letter boxes are alike
//     in all pictures. In blocks of 16 x 16 pixels with changes, the normalised correlation with
//     the rows of the other half is computed.
//  2. The best place is at most a tenth of the width away, and nowhere else in the rows is one
//     nearly as good. That excludes gratings, grids, bricks and other repetition. Most blocks with
//     detail have such a place.
//  3. The shifts differ, also among blocks above each other. Equal halves, tiled pictures, and two
//     copies of a photograph (before and after, colour and depth) have one shift; products of
//     patterns across and down have one per column.
//  4. The halves themselves do not repeat. Quilts are pairs of pairs: there, parts of a half are
//     alike, or the picture is a pair in both directions.
//
// Mirrored halves have the same detail in reverse, which does not correlate. Block matching as such
// is described by Scharstein and Szeliski, "A taxonomy and evaluation of dense two-frame stereo
// correspondence algorithms", IJCV 47 (2002). A test draws pairs and pictures of many other kinds
// and counts errors.
#include "frames/views_input/stereo_pair.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace lenticule::frames {
namespace {

constexpr int kWidth = 256, kMostRows = 512;
constexpr int kFewestColumns = 96, kFewestRows = 48;
constexpr int kBlock = 16;
constexpr double kReach = 0.1;        ///< largest shift, in parts of the width
constexpr double kLeastChange = 2.5;  ///< root mean square of the changes in a block with detail
constexpr double kMatch = 0.75;       ///< least correlation of a match
constexpr double kLead = 0.1;         ///< by which it exceeds the correlation of shifts elsewhere
constexpr int kPeak = 3;              ///< width of a correlation's peak to each side
constexpr int kFewestBlocks = 12;
constexpr double kLeastMatching = 0.6;
constexpr double kRepeats = 0.5;
constexpr double kLeastSpread = 1.4;  ///< between the shifts of far and near blocks
constexpr double kOwnSpread = 0.5;    ///< within columns of blocks

/// Part is a rectangle of a picture.
struct Part {
  int x = 0, y = 0, width = 0, height = 0;

  /// Returns one of `of` equal pieces, counted from the left or from the top.
  [[nodiscard]] Part piece(bool beside, int number, int of = 2) const {
    const int across = beside ? width / of : width, down = beside ? height : height / of;
    return {beside ? x + number * across : x, beside ? y : y + number * down, across, down};
  }
};

/// Changes holds, for each pixel of a reduced picture, how its brightness changes along the row.
struct Changes {
  int width = 0;
  int height = 0;
  std::vector<float> values;

  [[nodiscard]] const float* at(int x, int y) const {
    return values.data() + static_cast<ptrdiff_t>(y) * width + x;
  }
  float& pixel(int x, int y) { return values[static_cast<size_t>(int64_t{y} * width + x)]; }
};

/// Returns the mean brightness of each pixel of the reduced picture, in codes.
Changes reduce(const FrameView& picture, const Part& part) {
  Changes out;
  out.width = std::min(part.width, kWidth);
  out.height = std::clamp(static_cast<int>(int64_t{part.height} * out.width / part.width), 1,
                          std::min(part.height, kMostRows));
  out.values.resize(static_cast<size_t>(out.width) * static_cast<size_t>(out.height));
  const auto edge = [](int n, int from, int to) {
    return static_cast<int>(int64_t{n} * from / to);
  };
  std::vector<uint32_t> sums(static_cast<size_t>(part.width));
  for (int y = 0; y < out.height; ++y) {
    const int top = edge(y, part.height, out.height), end = edge(y + 1, part.height, out.height);
    std::ranges::fill(sums, 0U);
    for (int row = top; row < end; ++row) {
      const uint8_t* rgb = picture.bytes.data() +
                           static_cast<size_t>(part.y + row) * picture.geometry.row_bytes() +
                           static_cast<size_t>(part.x) * 3;
      for (uint32_t& sum : sums) {
        sum += rgb[0] + 2U * rgb[1] + rgb[2];
        rgb += 3;
      }
    }
    for (int x = 0; x < out.width; ++x) {
      const int left = edge(x, part.width, out.width), right = edge(x + 1, part.width, out.width);
      uint64_t sum = 0;
      for (int column = left; column < right; ++column) sum += sums[static_cast<size_t>(column)];
      const double pixels = double(right - left) * double(end - top);
      out.pixel(x, y) = static_cast<float>(double(sum) / (4.0 * pixels));
    }
  }
  return out;
}

/// Returns differences along the rows, smoothed in both directions: noise counts less, and they
/// vary slowly enough for shifts by parts of a pixel.
Changes changes_in(const FrameView& picture, const Part& part) {
  const Changes grey = reduce(picture, part);
  Changes out = grey;
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const auto column = [&](int dx) {
        const int at = std::clamp(x + dx, 0, out.width - 1);
        return *grey.at(at, std::max(y - 1, 0)) + 2 * *grey.at(at, y) +
               *grey.at(at, std::min(y + 1, out.height - 1));
      };
      out.pixel(x, y) = (column(2) + 2 * column(1) - 2 * column(-1) - column(-2)) / 16;
    }
  return out;
}

/// Returns the sum of the products of two blocks, whose rows are `stride` values apart.
double product(const float* a, const float* b, int stride) {
  std::array<float, kBlock> sums{};  // of columns, which the compiler computes at once
  for (int y = 0; y < kBlock; ++y, a += stride, b += stride)
    for (size_t x = 0; x < sums.size(); ++x) sums[x] += a[x] * b[x];
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

/// Match says where a block of one half is in the other.
struct Match {
  bool detailed = false;  ///< the block has enough detail
  bool found = false;
  bool unique = false;
  double shift = 0.0;  ///< pixels of the reduced picture, to the right
};

/// Searches the block at (x, y) of a half in the other half, `down` rows below, where the block at
/// each column has the product `theirs` with itself.
Match find_block(const Changes& in, const Changes& other, int x, int y, int down,
                 std::span<const double> theirs) {
  Match match;
  const float* const block = in.at(x, y);
  const double own = product(block, block, in.width);
  match.detailed = own >= kLeastChange * kLeastChange * kBlock * kBlock;
  if (!match.detailed) return match;
  std::vector<double> similar;  // by column
  for (const double one : theirs) {
    const float* const there = other.at(static_cast<int>(similar.size()), y + down);
    const bool same_contrast = one > own / 16 && one < own * 16;
    similar.push_back(same_contrast ? product(block, there, in.width) / std::sqrt(own * one) : 0.0);
  }
  const int reach = static_cast<int>(kReach * in.width);
  const auto near = std::span(similar).subspan(
      static_cast<size_t>(std::max(x - reach, 0)),
      static_cast<size_t>(std::min(x + reach, in.width - kBlock) - std::max(x - reach, 0) + 1));
  const auto best = std::ranges::max_element(near);
  match.found = *best >= kMatch;
  // At an end, the peak may lie beyond the reach.
  match.unique = best != near.begin() && best + 1 != near.end();
  if (!match.unique) return match;
  const ptrdiff_t column = &*best - similar.data();
  for (ptrdiff_t i = 0; i < std::ssize(similar); ++i)
    if (std::abs(i - column) > kPeak && similar[static_cast<size_t>(i)] > *best - kLead)
      match.unique = false;
  // The top of the parabola through three values.
  const double before = *(best - 1), after = *(best + 1), bend = 2 * *best - before - after;
  match.shift = static_cast<double>(column - x) + (bend > 0 ? (after - before) / (2 * bend) : 0);
  return match;
}

/// Returns the blocks of a half, row by row, where the other half has them. Both have one size.
std::vector<Match> find_blocks(const Changes& in, const Changes& other, int down) {
  std::vector<Match> blocks;
  for (int y = 0; y + kBlock <= in.height; y += kBlock) {
    if (y + down < 0 || y + down + kBlock > in.height) continue;
    std::vector<double> theirs;
    for (int x = 0; x + kBlock <= in.width; ++x)
      theirs.push_back(product(other.at(x, y + down), other.at(x, y + down), in.width));
    for (int x = 0; x + kBlock <= in.width; x += kBlock)
      blocks.push_back(find_block(in, other, x, y, down, theirs));
  }
  return blocks;
}

bool is_sure(const Match& match) { return match.found && match.unique; }

/// Returns the value below which that part of the values is; 0 without values.
double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<ptrdiff_t>(part * double(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

double spread_of(const std::vector<double>& shifts) {
  return quantile(shifts, 0.9) - quantile(shifts, 0.1);
}

/// Returns by how much shifts differ from the median of their column.
double spread_in_columns(const std::vector<Match>& blocks, size_t across) {
  std::vector<double> differences;
  for (size_t column = 0; column < across; ++column) {
    std::vector<double> shifts;
    for (size_t i = column; i < blocks.size(); i += across)
      if (is_sure(blocks[i])) shifts.push_back(blocks[i].shift);
    for (const double shift : shifts) differences.push_back(shift - quantile(shifts, 0.5));
  }
  return spread_of(differences);
}

std::optional<StereoPair> pair_in(const FrameView& picture, const Part& part, bool beside) {
  const Changes first = changes_in(picture, part.piece(beside, 0));
  const Changes second = changes_in(picture, part.piece(beside, 1));
  std::vector<Match> blocks;
  double matching = 0.0;
  for (const int down : {-1, 0, 1}) {  // cameras are not exactly level
    std::vector<Match> found = find_blocks(first, second, down);
    const auto detailed = std::ranges::count_if(found, &Match::detailed);
    const auto sure = std::ranges::count_if(found, is_sure);
    if (detailed < std::max<ptrdiff_t>(kFewestBlocks, std::ssize(found) / 8) ||
        double(sure) <= matching * double(detailed))
      continue;
    matching = double(sure) / double(detailed);
    blocks = std::move(found);
  }
  if (matching < kLeastMatching) return std::nullopt;
  std::vector<double> shifts;
  for (const Match& block : blocks)
    if (is_sure(block)) shifts.push_back(block.shift);
  if (spread_of(shifts) < kLeastSpread ||
      spread_in_columns(blocks, static_cast<size_t>(first.width / kBlock)) < kOwnSpread)
    return std::nullopt;
  // A point is further left in the second picture, by its disparity.
  return StereoPair{.layout = {},
                    .matching = matching,
                    .back = -quantile(shifts, 0.9) / first.width,
                    .front = -quantile(shifts, 0.1) / first.width};
}

/// Returns true if the first two of the part's pieces are alike: it is one of a quilt's columns, or
/// another repetition.
bool repeats(const FrameView& picture, const Part& part) {
  constexpr int kMostPieces = 9;
  for (int pieces = 2; pieces <= kMostPieces; ++pieces)
    for (const bool beside : {true, false}) {
      const Part first = part.piece(beside, 0, pieces);
      if (first.width < 2 * kBlock || first.height < kBlock) continue;
      const std::vector<Match> blocks = find_blocks(
          changes_in(picture, first), changes_in(picture, part.piece(beside, 1, pieces)), 0);
      const auto detailed = std::ranges::count_if(blocks, &Match::detailed);
      const auto found = std::ranges::count_if(blocks, &Match::found);
      if (detailed >= kFewestBlocks / 2 && double(found) > kRepeats * double(detailed)) return true;
    }
  return false;
}

/// Returns true for the shapes of films: 16:9, cinema, and between.
bool has_shape_of_film(const Part& whole) {
  const double aspect = static_cast<double>(whole.width) / whole.height;
  return (aspect > 1.7 && aspect < 1.95) || (aspect > 2.3 && aspect < 2.45);
}

}  // namespace

std::optional<StereoPair> find_stereo_pair(const FrameView& picture) {
  const Part whole{.width = picture.geometry.width, .height = picture.geometry.height};
  std::optional<StereoPair> found;
  for (const bool beside : {true, false}) {
    const Part half = whole.piece(beside, 0);
    if (half.width < kFewestColumns || half.height < kFewestRows) continue;
    std::optional<StereoPair> pair = pair_in(picture, whole, beside);
    if (!pair) continue;
    if (found || repeats(picture, half)) return std::nullopt;
    pair->layout = {.beside = beside, .half = has_shape_of_film(whole)};
    found = pair;
  }
  return found;
}

}  // namespace lenticule::frames
