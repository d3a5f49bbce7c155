// SPDX-License-Identifier: Apache-2.0
// Counters and times of one rendered frame.
#pragma once

#include <algorithm>
#include <array>

#include "render/options/frame_counts.h"
#include "render/options/work_clock.h"

namespace lenticule::render {

/// FrameErrors describes the errors of a frame of method adaptive; all are 0 without an audit.
struct FrameErrors {
  /// Upper bound, with 99.99 % confidence, of the share of all subpixels whose error exceeds the
  /// tolerated error.
  double beyond_bound = 0.0;
  /// Root mean square error of the audited subpixels in code values. That of the frame may be many
  /// times larger: few subpixels that are off by much are rarely among the audited ones.
  double audited_rmse = 0.0;
  /// Upper bound, with 99 % confidence, of the root mean square error of all subpixels.
  double rmse_bound = 0.0;
};

/// RenderStatistics describes the cost of one frame. Times are wall-clock seconds.
struct RenderStatistics : FrameCounts, FrameErrors {
  bool completed = true;
  double seconds = 0.0;
  /// Shares of the workers' time per kind of work; they add up to 1, or are zero if not measured.
  std::array<double, kWorks> work{};

  /// Adds counters and time of another frame, and keeps the larger errors and bounds.
  void add(const RenderStatistics& frame) {
    *this += frame;
    beyond_bound = std::max(beyond_bound, frame.beyond_bound);
    audited_rmse = std::max(audited_rmse, frame.audited_rmse);
    rmse_bound = std::max(rmse_bound, frame.rmse_bound);
    seconds += frame.seconds;
  }
};

}  // namespace lenticule::render
