// SPDX-License-Identifier: Apache-2.0
// Independent rows, shared among the machine's processors.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace lenticule::calib {

/// Calls row(j) once for each j in [0, rows), from several threads, which end before it returns.
/// `row` must not throw.
template <class Row>
void for_rows(int rows, const Row& row) {
  constexpr int kChunk = 8;
  std::atomic<int> next{0};
  const auto work = [&]() noexcept {
    for (int begin = next.fetch_add(kChunk); begin < rows; begin = next.fetch_add(kChunk))
      for (int j = begin; j < std::min(rows, begin + kChunk); ++j) row(j);
  };
  std::vector<std::jthread> helpers;
  const unsigned processors = std::max(1U, std::thread::hardware_concurrency());
  for (unsigned n = 1; n < processors && rows > kChunk; ++n) helpers.emplace_back(work);
  work();
}

}  // namespace lenticule::calib
