// SPDX-License-Identifier: Apache-2.0
// The rows of `lenticule bench stability`: one function each, one line each in rows.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "apps/lenticule-bench/stability/report.h"

namespace lenticule::bench {

struct StabilitySize {
  bool full = false;
  int threads = 0;  ///< 0 = all cores

  /// Returns the number of samples of a row.
  [[nodiscard]] uint64_t samples(uint64_t quick, uint64_t in_full) const {
    return full ? in_full : quick;
  }
};

struct StabilityCase {
  const char* name;
  /// Fills in everything except the name. Throws Error(Failed) if the measurement is not possible.
  StabilityRow (*run)(const StabilitySize& size);
};

/// Returns every row, in the order of the table.
[[nodiscard]] const std::vector<StabilityCase>& stability_cases();

/// Calls work(k) for k in [0, count) from several threads, in any order; stops early when the
/// program is interrupted. Rethrows the first exception.
void for_each_part(const StabilitySize& size, uint64_t count,
                   const std::function<void(uint64_t)>& work);

}  // namespace lenticule::bench
