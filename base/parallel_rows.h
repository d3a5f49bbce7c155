// SPDX-License-Identifier: Apache-2.0
// Work on the rows of a picture, shared by threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace lenticule {

/// Calls work(begin, end) for ranges of rows until all of [0, rows) are done, from this thread and
/// others, `threads` in all; 0 = as many as there are processors. `work` must not throw.
template <class Work>
void for_row_ranges(int rows, const Work& work, int threads = 0) {
  constexpr int kChunk = 8;
  constexpr int kMostThreads = 16;
  std::atomic<int> next{0};
  const auto take = [&]() noexcept {
    for (int begin = next.fetch_add(kChunk); begin < rows; begin = next.fetch_add(kChunk))
      work(begin, std::min(rows, begin + kChunk));
  };
  const auto processors = static_cast<int>(std::thread::hardware_concurrency());
  const int wanted = threads > 0 ? threads : std::clamp(processors, 1, kMostThreads);
  std::vector<std::jthread> helpers;
  for (int n = 1; n < wanted && rows > kChunk; ++n) helpers.emplace_back(take);
  take();
}

/// The same, row by row.
template <class Row>
void for_rows(int rows, const Row& row, int threads = 0) {
  for_row_ranges(
      rows,
      [&](int begin, int end) {
        for (int j = begin; j < end; ++j) row(j);
      },
      threads);
}

}  // namespace lenticule
