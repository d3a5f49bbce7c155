// SPDX-License-Identifier: Apache-2.0
// FrameSink is the smallest interface that shows woven frames. Calibration draws through it, so
// that simulated and real panels are interchangeable.
#pragma once

#include <chrono>

#include "frames/frame.h"

namespace lenticule::frames {

enum class ShowResult {
  Shown,     ///< the frame is on the panel
  TimedOut,  ///< deadline missed; the sink is still usable
  Lost,      ///< the display was disconnected
};

class FrameSink {
 public:
  virtual ~FrameSink() = default;

  /// Returns the exact size and format that show() requires.
  [[nodiscard]] virtual FrameGeometry geometry() const = 0;

  /// Copies the frame and waits until it is on the panel, at most `timeout`.
  ///
  /// Thread safety: one thread.
  [[nodiscard]] virtual ShowResult show(const FrameView& frame,
                                        std::chrono::nanoseconds timeout) = 0;
};

/// NullSink accepts frames of one size without showing them: photographs of them exist already.
class NullSink final : public FrameSink {
 public:
  NullSink(int width, int height) : geometry_{.width = width, .height = height} {}
  [[nodiscard]] FrameGeometry geometry() const override { return geometry_; }
  [[nodiscard]] ShowResult show(const FrameView&, std::chrono::nanoseconds) override {
    return ShowResult::Shown;
  }

 private:
  FrameGeometry geometry_;
};

}  // namespace lenticule::frames
