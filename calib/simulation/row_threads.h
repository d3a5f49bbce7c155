// SPDX-License-Identifier: Apache-2.0
// Splits the rows of a picture among a few threads.
#pragma once

#include <functional>

namespace lenticule::calib {

/// Calls row_work(0) ... row_work(rows - 1), each once, from `threads` threads of which the caller
/// is one; returns when all are done. Rethrows the first exception of the lowest thread.
void for_rows(int rows, int threads, const std::function<void(int)>& row_work);

}  // namespace lenticule::calib
