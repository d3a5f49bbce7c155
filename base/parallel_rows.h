// SPDX-License-Identifier: Apache-2.0
// Distributes work on the rows of a picture over threads.
#pragma once

#include <algorithm>
#include <thread>

#include "base/worker_threads.h"

namespace lenticule {

/// Calls work(begin, end) for ranges of rows until all rows in [0, rows) are done. Uses `threads`
/// threads in total, including the calling one; 0 = one per processor, at most 16. Rethrows an
/// exception of `work`.
template <class Work>
void for_row_ranges(int rows, const Work& work, int threads = 0) {
  constexpr int kChunk = 8;
  constexpr int kMostThreads = 16;
  const auto processors = static_cast<int>(std::thread::hardware_concurrency());
  const int wanted = threads > 0 ? threads : std::clamp(processors, 1, kMostThreads);
  const int chunks = (rows + kChunk - 1) / kChunk;
  WorkerThreads(std::clamp(chunks, 1, wanted))
      .run(chunks, [rows, &work](int chunk, int /*worker*/) {
        work(chunk * kChunk, std::min(rows, (chunk + 1) * kChunk));
      });
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
