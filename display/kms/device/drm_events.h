// SPDX-License-Identifier: Apache-2.0
// Reads a card's events. The events carry numbers, never pointers: a process that inherits a card
// also receives the events of the previous process.
#pragma once

#include <cstdint>
#include <span>

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

}  // namespace lenticule::display
