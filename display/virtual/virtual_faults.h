// SPDX-License-Identifier: Apache-2.0
// VirtualFaults injects faults into a virtual display that real displays also have.
#pragma once

#include <cstdint>

#include "display/display.h"

namespace lenticule::display {

enum class EventFate {
  Deliver,
  Drop,       ///< the flip happens, without an event
  Duplicate,  ///< the event is delivered twice
  Unplug,     ///< the display is lost from this vblank on
};

/// Asked once per event, on the presenter thread. The defaults describe a perfect display.
class VirtualFaults {
 public:
  virtual ~VirtualFaults() = default;
  /// Returns the delay of this vblank's event. A delay of more than a period makes the player miss
  /// a vblank.
  [[nodiscard]] virtual Nanoseconds event_delay(uint64_t sequence) noexcept {
    (void)sequence;
    return Nanoseconds{0};
  }
  [[nodiscard]] virtual EventFate fate(uint64_t sequence) noexcept {
    (void)sequence;
    return EventFate::Deliver;
  }
};

/// UniformJitter delays every event by 0 ... `most`, uniformly; deterministic for a given seed.
class UniformJitter final : public VirtualFaults {
 public:
  UniformJitter(Nanoseconds most, uint64_t seed) : most_(most), seed_(seed) {}
  [[nodiscard]] Nanoseconds event_delay(uint64_t sequence) noexcept override;

 private:
  Nanoseconds most_;
  uint64_t seed_;
};

}  // namespace lenticule::display
