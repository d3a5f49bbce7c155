// SPDX-License-Identifier: Apache-2.0
// RowBuckets finds the primitives that may be visible in a pixel row.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lenticule::render {

/// Rows [first, last]; empty if last < first.
struct RowRange {
  int first = 0;
  int last = -1;
};

/// RowBuckets is a segment tree over the rows. Each number is stored in the few nodes that cover
/// its range, so that a row's numbers are those on the path from its leaf to the root, and even a
/// million ranges over all rows take a few nodes each. Thread safety: immutable, usable from any
/// thread.
class RowBuckets {
 public:
  /// Stores number n with ranges[n], clipped to [0, rows).
  RowBuckets(int rows, std::span<const RowRange> ranges);

  /// Calls number(n) for each number n whose range contains `row`, in an order that depends on the
  /// ranges only.
  template <class Visit>
  void visit(int row, const Visit& number) const {
    for (size_t node = rows_ + static_cast<size_t>(row); node > 0; node >>= 1)
      for (size_t n = begin_[node]; n < begin_[node + 1]; ++n) number(numbers_[n]);
  }

 private:
  size_t rows_;
  std::vector<size_t> begin_;  ///< first element in numbers_, per node
  std::vector<uint32_t> numbers_;
};

}  // namespace lenticule::render
