// SPDX-License-Identifier: Apache-2.0
// TimedDisplay passes everything on to a display, and notes the vblank at which each frame
// appeared.
#pragma once

#include <cstdint>
#include <vector>

#include "display/display.h"

namespace lenticule::bench {

/// The frames' ids are their indices in the playback. Thread safety: as display::Display. Lifetime:
/// must not outlive the display.
class TimedDisplay final : public display::Display {
 public:
  TimedDisplay(display::Display& display, uint64_t most_frames)
      : display_(display), shown_ns_(most_frames) {}

  /// Returns the time of the first vblank that showed each frame, by index, in nanoseconds of the
  /// display's clock; 0 if the frame was not shown. Call it after the playback.
  [[nodiscard]] const std::vector<int64_t>& shown_ns() const { return shown_ns_; }

  [[nodiscard]] const display::DisplayMode& mode() const override { return display_.mode(); }
  [[nodiscard]] display::ScanoutBuffer* acquire() override { return display_.acquire(); }
  void discard(display::ScanoutBuffer* buffer) override { display_.discard(buffer); }
  [[nodiscard]] display::SubmitStatus submit(display::ScanoutBuffer* buffer,
                                             uint64_t id) noexcept override {
    return display_.submit(buffer, id);
  }
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override {
    return display_.request_vblank(sequence);
  }
  [[nodiscard]] display::DisplayEvent wait_event(display::Nanoseconds deadline,
                                                 int wake_fd) noexcept override {
    const display::DisplayEvent event = display_.wait_event(deadline, wake_fd);
    if (event.kind == display::EventKind::Flip && event.id < shown_ns_.size() &&
        shown_ns_[event.id] == 0)
      shown_ns_[event.id] = event.time.count();
    return event;
  }
  [[nodiscard]] bool set_power(bool on) noexcept override { return display_.set_power(on); }
  [[nodiscard]] display::Nanoseconds now() const noexcept override { return display_.now(); }

 private:
  display::Display& display_;
  std::vector<int64_t> shown_ns_;
};

}  // namespace lenticule::bench
