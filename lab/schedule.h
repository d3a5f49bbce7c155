// SPDX-License-Identifier: Apache-2.0
// Simulates how long measured work takes on more cores than the machine has.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <queue>
#include <vector>

namespace lenticule::lab {

/// Returns the time that `cores` cores take for the items of a loop, whose times are given, by list
/// scheduling: each item, in order, begins on the core that is free first. `cores` is at least 1.
[[nodiscard]] inline double scheduled_time(const std::vector<double>& items, int cores) {
  std::priority_queue<double, std::vector<double>, std::greater<>> free_at(
      std::greater<>{}, std::vector<double>(static_cast<size_t>(cores), 0.0));
  double end = 0.0;
  for (const double item : items) {
    const double done = free_at.top() + item;
    free_at.pop();
    free_at.push(done);
    end = std::max(end, done);
  }
  return end;
}

/// Returns the time of loops, each of which begins when all items of the one before have ended.
[[nodiscard]] inline double scheduled_time(const std::vector<std::vector<double>>& loops,
                                           int cores) {
  double sum = 0.0;
  for (const std::vector<double>& items : loops) sum += scheduled_time(items, cores);
  return sum;
}

}  // namespace lenticule::lab
