// SPDX-License-Identifier: Apache-2.0
// Distributes work on the rows of a picture over threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace lenticule {

/// Calls work(begin, end) for ranges of rows until all rows in [0, rows) are done. Uses `threads`
/// threads in total, including the calling one; 0 = one per processor, at most 16. `work` must not
/// throw.
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

/// Calls row(j) for every row, distributed as in for_row_ranges().
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
