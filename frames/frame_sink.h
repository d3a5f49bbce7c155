// SPDX-License-Identifier: Apache-2.0
// The smallest thing that can show woven frames. Calibration draws through it, so that a simulated
// panel and a real one are the same to it.
#pragma once

#include <chrono>

#include "frames/frame.h"

namespace lenticule::frames {

enum class ShowResult {
  Shown,     ///< the frame is on the glass
  TimedOut,  ///< not within the deadline; the sink is still usable
  Lost,      ///< the display went away
};

class FrameSink {
 public:
  virtual ~FrameSink() = default;

  /// The exact size and format that show() takes.
  [[nodiscard]] virtual FrameGeometry geometry() const = 0;

  /// Copies the frame and waits until it is on the glass, at most `timeout`. One thread.
  [[nodiscard]] virtual ShowResult show(const FrameView& frame,
                                        std::chrono::nanoseconds timeout) = 0;
};

}  // namespace lenticule::frames
