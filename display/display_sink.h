// SPDX-License-Identifier: Apache-2.0
// DisplaySink makes any display a FrameSink: it shows one frame at a time and waits until the frame
// is displayed.
#pragma once

#include "base/error.h"
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
                                        Nanoseconds timeout) override {
    if (frame.geometry != geometry())
      throw Error(ErrorKind::Input, "display: the frame's size differs from the panel's");
    const Nanoseconds deadline = display_.now() + timeout;

    // An earlier flip that timed out may still hold its buffer and the display's one pending flip.
    ScanoutBuffer* buffer = display_.acquire();
    while (buffer == nullptr) {
      const DisplayEvent event = display_.wait_event(deadline, -1);
      if (event.kind == EventKind::Lost) return frames::ShowResult::Lost;
      buffer = display_.acquire();
      if (buffer == nullptr && event.kind == EventKind::Timeout)
        return frames::ShowResult::TimedOut;
    }
    buffer->fill(frame);

    const uint64_t id = next_id_++;
    bool submitted = false;
    while (true) {
      if (!submitted) {
        const SubmitStatus status = display_.submit(buffer, id);
        submitted = status == SubmitStatus::Accepted;
        if (status == SubmitStatus::Lost) {
          display_.discard(buffer);
          return frames::ShowResult::Lost;
        }
      }
      const DisplayEvent event = display_.wait_event(deadline, -1);
      if (event.kind == EventKind::Lost) return frames::ShowResult::Lost;
      if (event.kind == EventKind::Flip && event.id == id) return frames::ShowResult::Shown;
      if (event.kind == EventKind::Timeout && display_.now() >= deadline) {
        if (!submitted) display_.discard(buffer);
        return frames::ShowResult::TimedOut;
      }
    }
  }

 private:
  Display& display_;
  uint64_t next_id_ = 1;
};

}  // namespace lenticule::display
