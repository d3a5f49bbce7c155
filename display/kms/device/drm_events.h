// SPDX-License-Identifier: Apache-2.0
// Reads a card's events, and waits for them and for other descriptors. Events carry numbers, never
// pointers: a process that takes over a card also receives the events of the previous process.
#pragma once

#include <cstdint>
#include <span>

#include "base/unique_fd.h"
#include "display/clock.h"
#include "display/display.h"

namespace lenticule::display {

struct DrmEvent {
  enum class Kind { Flip, Sequence };
  Kind kind = Kind::Flip;
  uint64_t id = 0;
  uint64_t sequence = 0;  ///< low 32 bits for flips
  Nanoseconds time{0};    ///< CLOCK_MONOTONIC; 0 if the driver does not know
  uint32_t crtc = 0;      ///< set for flips
};

class DrmEventHandler {
 public:
  virtual ~DrmEventHandler() = default;
  virtual void on_drm_event(const DrmEvent& event) noexcept = 0;
};

enum class EventRead {
  Ok,         ///< all available events were handled
  Truncated,  ///< an incomplete event was found; the events before it were handled
  Gone,       ///< the card is gone
};

/// Reads once, without blocking, and passes every complete event to the handler.
[[nodiscard]] EventRead read_drm_events(int fd, DrmEventHandler& handler) noexcept;

/// Parses events that were read.
[[nodiscard]] EventRead parse_drm_events(std::span<const uint8_t> bytes,
                                         DrmEventHandler& handler) noexcept;

struct ReadySet {
  bool card = false;
  bool card_gone = false;
  bool session = false;
  bool hotplug = false;
  bool wake = false;  ///< the caller's own descriptor
};

/// EventWaiter waits for several descriptors at once by the display's clock. It allocates no memory
/// after construction. Thread safety: one thread.
class EventWaiter {
 public:
  /// Descriptors of -1 are never ready. Throws Error(Failed).
  EventWaiter(int card_fd, int session_fd, int hotplug_fd);

  /// Waits until a descriptor is ready or `deadline` has passed; `wake_fd` as for
  /// Display::wait_event().
  [[nodiscard]] ReadySet wait(Clock& clock, Nanoseconds deadline, int wake_fd) noexcept;

 private:
  enum Source : uint32_t { kCard, kSession, kHotplug, kWake };

  void add(int fd, Source source);
  void watch_wake(int fd) noexcept;

  UniqueFd epoll_;
  int wake_fd_ = -1;
};

}  // namespace lenticule::display
