// SPDX-License-Identifier: Apache-2.0
// Display flips whole woven frames at its own clock. Virtual and KMS displays look the same to the
// player.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "frames/frame.h"
#include "frames/rational.h"

namespace lenticule::display {

/// Nanoseconds of CLOCK_MONOTONIC, or of the simulated clock that a test injects.
using Nanoseconds = std::chrono::nanoseconds;

struct DisplayMode {
  frames::FrameGeometry geometry;
  frames::Rate refresh;
  std::string name;               ///< name for people: "virtual 3840x2160@60"
  std::string panel = "virtual";  ///< identity of the panel for people
  /// False if the display has no vblank counter and sequences are derived from time.
  bool hardware_clock = false;
};

enum class SubmitStatus {
  Accepted,
  Busy,    ///< a flip is pending: wait for its event and submit again
  Paused,  ///< another session is active (VT switched away): keep the frame and wait
  Lost,    ///< the display is gone; reconnect() may bring it back
};

enum class EventKind {
  Flip,     ///< the frame with `id` has been displayed since vblank `sequence`
  Vblank,   ///< a vblank requested with request_vblank()
  Timeout,  ///< no event until the deadline
  Lost,
};

struct DisplayEvent {
  EventKind kind = EventKind::Timeout;
  uint64_t id = 0;
  uint64_t sequence = 0;  ///< 64-bit vblank counter, never wraps
  Nanoseconds time{0};    ///< time of the vblank, display clock
};

/// Memory that the display scans out. One thread may fill it between acquire() and submit().
class ScanoutBuffer {
 public:
  virtual ~ScanoutBuffer() = default;
  /// Copies the whole frame, converting it to the scan-out format without changing a subpixel.
  /// noexcept: the sizes were checked when the display was opened.
  virtual void fill(const frames::FrameView& frame) noexcept = 0;
  /// Copies a box over the frame in the buffer, in the same way. Its first pixel is at (left, top)
  /// of the frame, or of the picture `part` of a frame for several panels; it lies within that.
  virtual void fill_box(const frames::FrameView& box, int left, int top, size_t part) noexcept = 0;
};

/// No function throws or allocates after opening. Thread safety: submit(), wait_event() and
/// request_vblank() belong to one presenter thread; one other thread may use acquire() and
/// ScanoutBuffer::fill().
class Display {
 public:
  virtual ~Display() = default;

  [[nodiscard]] virtual const DisplayMode& mode() const = 0;

  /// Returns a buffer that is neither displayed nor pending, or null if all are in use.
  [[nodiscard]] virtual ScanoutBuffer* acquire() = 0;
  /// Returns a buffer to the display that will not be submitted.
  virtual void discard(ScanoutBuffer* buffer) = 0;

  /// Displays the buffer from the next vblank on. The Flip event contains `id`. At most one flip is
  /// pending; the previously displayed buffer is free again once the event is delivered.
  [[nodiscard]] virtual SubmitStatus submit(ScanoutBuffer* buffer, uint64_t id) noexcept = 0;

  /// Requests one Vblank event at the next vblank after `sequence`.
  [[nodiscard]] virtual bool request_vblank(uint64_t sequence) noexcept = 0;

  /// Waits for the next event, at most until `deadline` (display clock). If `wake_fd` (or -1)
  /// becomes readable, returns Timeout early.
  [[nodiscard]] virtual DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept = 0;

  /// Switches the output off, so that it shows nothing, or on again with the last frame. Call it
  /// only while no flip is pending. While the output is off, submit() returns Paused, and vblanks
  /// are counted by time. Returns false if the output could not be switched off for now.
  [[nodiscard]] virtual bool set_power(bool on) noexcept = 0;

  /// Returns the current time of the display's clock.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
};

}  // namespace lenticule::display
