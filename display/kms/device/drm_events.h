// SPDX-License-Identifier: Apache-2.0
// Reads what a card reports. The events carry numbers of ours, never pointers: a process that
// inherits a card also inherits the events meant for the one before it.
#pragma once

#include <cstdint>
#include <span>

#include "display/display.h"

namespace lenticule::display {

struct DrmEvent {
  enum class Kind { Flip, Sequence };
  Kind kind = Kind::Flip;
  uint64_t id = 0;
  uint64_t sequence = 0;  ///< 32 bits of it for flips
  Nanoseconds time{0};    ///< CLOCK_MONOTONIC; 0 if the driver has no idea
  uint32_t crtc = 0;      ///< of flips
};

class DrmEventHandler {
 public:
  virtual ~DrmEventHandler() = default;
  virtual void on_drm_event(const DrmEvent& event) noexcept = 0;
};

enum class EventRead {
  Ok,         ///< whatever there was has been handled
  Truncated,  ///< something that is not a whole event; what came before it was handled
  Gone,       ///< the card went away
};

/// Reads once, without blocking, and hands over every whole event.
[[nodiscard]] EventRead read_drm_events(int fd, DrmEventHandler& handler) noexcept;

/// The parsing part alone.
[[nodiscard]] EventRead parse_drm_events(std::span<const uint8_t> bytes,
                                         DrmEventHandler& handler) noexcept;

}  // namespace lenticule::display
