// SPDX-License-Identifier: Apache-2.0
// A display that flips whole woven frames at its own clock. Virtual and KMS displays are the same
// to the player.
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
  std::string name;  ///< for people: "virtual 3840x2160@60"
  /// False when the display has no vblank counter and sequences are derived from time.
  bool hardware_clock = false;
};

enum class SubmitStatus {
  Accepted,
  Busy,    ///< a flip is still pending: wait for its event and submit again
  Paused,  ///< not ours at the moment (VT switched away): keep the frame, go on waiting
  Lost,    ///< the display went away; reconnect() may bring it back
};

enum class EventKind {
  Flip,     ///< the frame with `id` is on the glass since vblank `sequence`
  Vblank,   ///< a vblank that was asked for with request_vblank()
  Timeout,  ///< nothing happened until the deadline
  Lost,
};

struct DisplayEvent {
  EventKind kind = EventKind::Timeout;
  uint64_t id = 0;
  uint64_t sequence = 0;  ///< vblank counter, 64 bits, never wraps
  Nanoseconds time{0};    ///< of the vblank, display clock
};

/// Memory that the display scans out. Filled by any one thread between acquire() and submit().
class ScanoutBuffer {
 public:
  virtual ~ScanoutBuffer() = default;
  /// Copies the whole frame in, converting to the scan-out format without changing a subpixel.
  /// noexcept: sizes were agreed when the display was opened.
  virtual void fill(const frames::FrameView& frame) noexcept = 0;
};

/// Threads: submit(), wait_event() and request_vblank() belong to one presenter thread; acquire()
/// and ScanoutBuffer::fill() may be used by one other. Nothing here throws or allocates after
/// opening.
class Display {
 public:
  virtual ~Display() = default;

  [[nodiscard]] virtual const DisplayMode& mode() const = 0;

  /// A buffer that is neither on the glass nor pending, or null if all are in use.
  [[nodiscard]] virtual ScanoutBuffer* acquire() = 0;
  /// Gives back a buffer that will not be submitted.
  virtual void discard(ScanoutBuffer* buffer) = 0;

  /// Shows the buffer from the next vblank on. `id` comes back in the Flip event. At most one flip
  /// is pending; the buffer shown before is free again once the event is delivered.
  [[nodiscard]] virtual SubmitStatus submit(ScanoutBuffer* buffer, uint64_t id) noexcept = 0;

  /// Asks for one Vblank event at the next vblank after `sequence`.
  [[nodiscard]] virtual bool request_vblank(uint64_t sequence) noexcept = 0;

  /// Waits for the next event, at most until `deadline` (display clock). `wake_fd` (or -1) being
  /// readable ends the wait early with Timeout.
  [[nodiscard]] virtual DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept = 0;

  /// The display's clock.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
};

}  // namespace lenticule::display
