// SPDX-License-Identifier: Apache-2.0
// Any display as a FrameSink: one frame at a time, waited for until it is on the glass.
#pragma once

#include "display/display.h"
#include "frames/frame_sink.h"

namespace lenticule::display {

/// Borrows the display, which nobody else may use meanwhile. One thread.
class DisplaySink final : public frames::FrameSink {
 public:
  explicit DisplaySink(Display& display) : display_(display) {}

  [[nodiscard]] frames::FrameGeometry geometry() const override { return display_.mode().geometry; }
  [[nodiscard]] frames::ShowResult show(const frames::FrameView& frame,
                                        Nanoseconds timeout) override;

 private:
  Display& display_;
  uint64_t next_id_ = 1;
};

}  // namespace lenticule::display
