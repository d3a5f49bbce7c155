// SPDX-License-Identifier: Apache-2.0
// Threads that live for one picture.
#include "calib/simulation/row_threads.h"

#include <exception>
#include <thread>
#include <vector>

namespace lenticule::calib {

void for_rows(int rows, int threads, const std::function<void(int)>& row_work) {
  std::vector<std::exception_ptr> failures(static_cast<size_t>(threads));
  const auto every_nth = [&](int first) {
    try {
      for (int row = first; row < rows; row += threads) row_work(row);
    } catch (...) {
      failures[static_cast<size_t>(first)] = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    for (int first = 1; first < threads; ++first) others.emplace_back(every_nth, first);
    every_nth(0);
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

}  // namespace lenticule::calib
