// SPDX-License-Identifier: Apache-2.0
// What can go wrong with a virtual display on purpose: real displays do all of it by themselves.
#pragma once

#include <cstdint>

#include "display/display.h"

namespace lenticule::display {

enum class EventFate {
  Deliver,
  Drop,       ///< the flip happens, nobody hears of it
  Duplicate,  ///< the event comes twice
  Unplug,     ///< the display is gone from this vblank on
};

/// Asked once per event, on the presenter thread. The defaults are a perfect display.
class VirtualFaults {
 public:
  virtual ~VirtualFaults() = default;
  /// How late the event of this vblank is delivered. More than a period makes the player miss one.
  [[nodiscard]] virtual Nanoseconds event_delay(uint64_t sequence) noexcept {
    (void)sequence;
    return Nanoseconds{0};
  }
  [[nodiscard]] virtual EventFate fate(uint64_t sequence) noexcept {
    (void)sequence;
    return EventFate::Deliver;
  }
};

/// Delays every event by 0 ... `most`, uniformly; the same for the same seed.
class UniformJitter final : public VirtualFaults {
 public:
  UniformJitter(Nanoseconds most, uint64_t seed) : most_(most), seed_(seed) {}
  [[nodiscard]] Nanoseconds event_delay(uint64_t sequence) noexcept override;

 private:
  Nanoseconds most_;
  uint64_t seed_;
};

}  // namespace lenticule::display
