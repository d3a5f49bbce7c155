// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/mark_moves.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "base/statistics.h"

namespace lenticule::calib {
namespace {

constexpr size_t kFewest = 4;

Vec2 middle(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  std::vector<double> x, y;
  for (size_t n = begin; n < end; ++n) {
    x.push_back(moves[n].x);
    y.push_back(moves[n].y);
  }
  return {upper_median(std::move(x)), upper_median(std::move(y))};
}

/// Returns the sum of the distances from the middle.
double misfit(const std::vector<Vec2>& moves, size_t begin, size_t end) {
  const Vec2 place = middle(moves, begin, end);
  double sum = 0.0;
  for (size_t n = begin; n < end; ++n)
    sum += std::abs(moves[n].x - place.x) + std::abs(moves[n].y - place.y);
  return sum;
}

}  // namespace

std::optional<MarkStep> find_step(const std::vector<Vec2>& moves) {
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t n = kFewest; n + kFewest <= moves.size(); ++n) {
    const double sum = misfit(moves, 0, n) + misfit(moves, n, moves.size());
    if (sum >= least) continue;
    least = sum;
    best = n;
  }
  if (best == 0) return std::nullopt;
  const Vec2 step = middle(moves, best, moves.size()) - middle(moves, 0, best);
  const double length = std::hypot(step.x, step.y);
  return length > kKnockPx ? std::optional(MarkStep{best, length}) : std::nullopt;
}

std::string moved_between(size_t picture) {
  return fmt::format("the camera moved between photograph {} and {}", picture, picture + 1);
}

}  // namespace lenticule::calib
