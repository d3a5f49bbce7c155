// SPDX-License-Identifier: Apache-2.0
#include "display/display_sink.h"

#include "base/error.h"

namespace lenticule::display {

using frames::ShowResult;

frames::ShowResult DisplaySink::show(const frames::FrameView& frame, Nanoseconds timeout) {
  if (frame.geometry != geometry())
    throw Error(ErrorKind::Input, "display: the frame's size differs from the panel's");
  const Nanoseconds deadline = display_.now() + timeout;

  // An earlier flip that timed out may still hold its buffer and the display's one pending flip.
  ScanoutBuffer* buffer = display_.acquire();
  while (buffer == nullptr) {
    const DisplayEvent event = display_.wait_event(deadline, -1);
    if (event.kind == EventKind::Lost) return ShowResult::Lost;
    buffer = display_.acquire();
    if (buffer == nullptr && event.kind == EventKind::Timeout) return ShowResult::TimedOut;
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
        return ShowResult::Lost;
      }
    }
    const DisplayEvent event = display_.wait_event(deadline, -1);
    if (event.kind == EventKind::Lost) return ShowResult::Lost;
    if (event.kind == EventKind::Flip && event.id == id) return ShowResult::Shown;
    if (event.kind == EventKind::Timeout && display_.now() >= deadline) {
      if (!submitted) display_.discard(buffer);
      return ShowResult::TimedOut;
    }
  }
}

}  // namespace lenticule::display
