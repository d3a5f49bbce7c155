// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/depth_oracle.h"

#include <cmath>

#include "frames/srgb.h"

namespace lenticule::test {
namespace {

constexpr long double kJoined = 1.5L;
constexpr long double kHair = 1e-9L;

/// A piece of the row from pixel `left` to pixel `right`; at an edge both are the same pixel, for
/// half a pixel.
struct Piece {
  long double begin, end;
  int left, right;
};

bool joined(const DepthRow& row, int left) {
  const int width = static_cast<int>(row.disparity.size());
  if (left < 0 || left + 1 >= width) return false;
  const auto at = static_cast<size_t>(left);
  return std::abs(static_cast<long double>(row.disparity[at + 1]) - row.disparity[at]) <= kJoined;
}

std::vector<Piece> pieces_of(const DepthRow& row, int view, int views) {
  const long double turn = (static_cast<long double>(view) - (views - 1) / 2.0L) / (views - 1.0L);
  const auto place = [&](int i) {
    return i + 0.5L - static_cast<long double>(row.disparity[static_cast<size_t>(i)]) * turn;
  };
  std::vector<Piece> pieces;
  for (int i = 0; i < static_cast<int>(row.disparity.size()); ++i) {
    if (!joined(row, i - 1)) pieces.push_back({place(i) - 0.5L, place(i), i, i});
    if (joined(row, i))
      pieces.push_back({place(i), place(i + 1), i, i + 1});
    else
      pieces.push_back({place(i), place(i) + 0.5L, i, i});
  }
  return pieces;
}

struct Hit {
  Piece piece;
  long double share;
  long double disparity;
  bool surely;
};

/// Returns the nearest pieces at pixel k; several if rounding decides between them.
std::vector<Hit> hits_at(const DepthRow& row, const std::vector<Piece>& pieces, int k) {
  const long double x = k + 0.5L;
  std::vector<Hit> hits;
  long double nearest = -1e30L;
  for (const Piece& piece : pieces) {
    if (x < piece.begin - kHair || x > piece.end + kHair) continue;
    const long double share =
        piece.left == piece.right ? 0.0L : (x - piece.begin) / (piece.end - piece.begin);
    const long double here = row.disparity[static_cast<size_t>(piece.left)];
    const long double there = row.disparity[static_cast<size_t>(piece.right)];
    const bool surely = x > piece.begin + kHair && x < piece.end - kHair;
    hits.push_back({piece, share, here + share * (there - here), surely});
    if (surely) nearest = std::max(nearest, hits.back().disparity);
  }
  std::erase_if(hits, [&](const Hit& hit) { return hit.disparity < nearest - 1e-6L; });
  return hits;
}

Colour colour_of(const DepthRow& row, const Hit& hit) {
  Colour colour{};
  for (size_t c = 0; c < 3; ++c) {
    const auto light = [&](int i) {
      return frames::linear_of_codes()[static_cast<size_t>(row.codes[static_cast<size_t>(i)][c])];
    };
    const auto share = static_cast<double>(hit.share);
    colour[c] = frames::code_from_linear(light(hit.piece.left) * (1.0 - share) +
                                         light(hit.piece.right) * share);
  }
  return colour;
}

/// Returns the next pixel inside the surface that ends there.
int inner_pixel(const DepthRow& row, const Hit& edge, int step) {
  const int source = edge.piece.left;
  const bool same = step < 0 ? joined(row, source - 1) : joined(row, source);
  return same ? source + step : source;
}

/// Returns true if the pixel is covered however rounding decides: inside a piece, or where one
/// piece ends and another begins.
bool certain(const std::vector<Hit>& hits, int k) {
  bool ends = false, begins = false;
  for (const Hit& hit : hits) {
    if (hit.surely) return true;
    ends = ends || hit.piece.end < k + 0.5L + kHair;
    begins = begins || hit.piece.begin > k + 0.5L - kHair;
  }
  return ends && begins;
}

/// Returns the pieces that may bound a hole on one side.
std::vector<Hit> edge_of_hole(const DepthRow& row, const std::vector<Piece>& pieces, int k,
                              int step) {
  const int width = static_cast<int>(row.disparity.size());
  std::vector<Hit> edges;
  for (int at = k + step; at >= 0 && at < width; at += step) {
    const std::vector<Hit> hits = hits_at(row, pieces, at);
    edges.insert(edges.end(), hits.begin(), hits.end());
    if (certain(hits, at)) break;
  }
  return edges;
}

bool may_be_farther(const Hit& hit, const std::vector<Hit>& others) {
  for (const Hit& other : others)
    if (hit.disparity <= other.disparity + 1e-6L) return true;
  return others.empty();
}

void add_fills(const DepthRow& row, const std::vector<Piece>& pieces, int k,
               std::vector<Colour>& colours) {
  const auto left = edge_of_hole(row, pieces, k, -1);
  const auto right = edge_of_hole(row, pieces, k, 1);
  for (const Hit& hit : left)
    if (may_be_farther(hit, right))
      colours.push_back(row.codes[static_cast<size_t>(inner_pixel(row, hit, -1))]);
  for (const Hit& hit : right)
    if (may_be_farther(hit, left))
      colours.push_back(row.codes[static_cast<size_t>(inner_pixel(row, hit, 1))]);
  if (left.empty() && right.empty()) colours.push_back(row.codes[static_cast<size_t>(k)]);
}

}  // namespace

std::vector<Colour> depth_oracle(const DepthRow& row, int view, int views, int k) {
  const std::vector<Piece> pieces = pieces_of(row, view, views);
  const std::vector<Hit> hits = hits_at(row, pieces, k);
  std::vector<Colour> colours;
  for (const Hit& hit : hits) colours.push_back(colour_of(row, hit));
  if (!certain(hits, k)) add_fills(row, pieces, k, colours);
  return colours;
}

}  // namespace lenticule::test
