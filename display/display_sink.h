// SPDX-License-Identifier: Apache-2.0
// DisplaySink makes any display a FrameSink: it shows one frame at a time and waits until the frame
// is displayed.
#pragma once

#include "display/display.h"
#include "frames/frame_source.h"

namespace lenticule::display {

/// Thread safety: one thread. Lifetime: the display must outlive the sink, and no other code may
/// use the display meanwhile.
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
