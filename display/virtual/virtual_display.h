// SPDX-License-Identifier: Apache-2.0
// A display without hardware: its own vblank clock, scan-out buffers in ordinary memory.
#pragma once

#include <memory>

#include "display/clock.h"
#include "display/display.h"
#include "display/scanout_recorder.h"
#include "display/virtual/virtual_faults.h"

namespace lenticule::display {

struct VirtualDisplayOptions {
  frames::FrameGeometry geometry = {};
  frames::Rate refresh{60, 1};
  /// 2 ... 16: one on the glass, one pending, the rest being filled ahead.
  int buffers = 3;
  /// Real time when null.
  std::shared_ptr<Clock> clock = nullptr;
  /// None when null.
  std::shared_ptr<VirtualFaults> faults = nullptr;
  /// None when null. In real time it runs on a thread of its own, over 2 to 64 more
  /// buffers (64 MiB where that is more than two): a frame that finds all of them busy is counted,
  /// not recorded, so that recording never disturbs pacing.
  /// In simulated time it runs inside wait_event() and misses nothing.
  std::shared_ptr<ScanoutRecorder> recorder = nullptr;
};

/// A flip submitted at time t is on the glass from the first vblank after t. Vblank 0 is the time
/// of opening. What is not recorded yet is recorded before the destructor returns.
///
/// Throws Error(Usage) for absurd options and Error(Failed) when the buffers would take more than
/// half of the free memory.
[[nodiscard]] std::unique_ptr<Display> open_virtual_display(const VirtualDisplayOptions& options);

}  // namespace lenticule::display
