// SPDX-License-Identifier: Apache-2.0
// Which primitives can be met on which pixel row.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lenticule::render {

/// Rows [first, last]; none where last < first.
struct RowRange {
  int first = 0;
  int last = -1;
};

/// A binary tree over the rows. Each number lies in the few nodes that make up its range, so that a
/// row's numbers are those on the way from its leaf to the root, and a million ranges of all rows
/// take a few nodes each. Immutable, safe from any thread.
class RowBuckets {
 public:
  /// Number n has ranges[n], clipped to [0, rows).
  RowBuckets(int rows, std::span<const RowRange> ranges);

  /// Calls visit(number) for each number whose range holds `row`, in an order that depends on the
  /// ranges alone.
  template <class Visit>
  void visit(int row, const Visit& number) const {
    for (size_t node = rows_ + static_cast<size_t>(row); node > 0; node >>= 1)
      for (size_t n = begin_[node]; n < begin_[node + 1]; ++n) number(numbers_[n]);
  }

 private:
  size_t rows_;
  std::vector<size_t> begin_;  ///< of each node in numbers_
  std::vector<uint32_t> numbers_;
};

}  // namespace lenticule::render
