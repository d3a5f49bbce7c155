// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/row_buckets.h"

#include <algorithm>

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Calls visit(node) for the nodes that cover a range. Leaf j is node rows + j; the children of
/// node n are 2 n and 2 n + 1.
template <class Visit>
void cover(size_t rows, RowRange range, const Visit& visit) {
  const int first = std::max(range.first, 0);
  const int last = std::min(range.last, static_cast<int>(rows) - 1);
  if (last < first) return;
  size_t low = rows + static_cast<size_t>(first);
  size_t high = rows + static_cast<size_t>(last) + 1;
  for (; low < high; low >>= 1, high >>= 1) {
    if (low & 1) visit(low++);
    if (high & 1) visit(--high);
  }
}

}  // namespace

RowBuckets::RowBuckets(int rows, std::span<const RowRange> ranges)
    : rows_(static_cast<size_t>(std::max(rows, 1))), begin_(2 * rows_ + 1) {
  LENTICULE_CHECK(ranges.size() <= UINT32_MAX);
  for (const RowRange& range : ranges)
    cover(rows_, range, [&](size_t node) { ++begin_[node + 1]; });
  for (size_t node = 1; node < begin_.size(); ++node) begin_[node] += begin_[node - 1];
  numbers_.resize(begin_.back());
  std::vector<size_t> next(begin_.begin(), begin_.end() - 1);
  for (size_t n = 0; n < ranges.size(); ++n)
    cover(rows_, ranges[n],
          [&](size_t node) { numbers_[next[node]++] = static_cast<uint32_t>(n); });
}

}  // namespace lenticule::render
