// SPDX-License-Identifier: Apache-2.0
// Scripts the faults of a virtual display, vblank by vblank.
#pragma once

#include <map>

#include "display/virtual/virtual_display.h"

namespace lenticule::test {

class ScriptedFaults final : public display::VirtualFaults {
 public:
  std::map<uint64_t, display::Nanoseconds> delays;
  std::map<uint64_t, display::EventFate> fates;
  display::EventFate otherwise = display::EventFate::Deliver;

  [[nodiscard]] display::Nanoseconds event_delay(uint64_t sequence) noexcept override {
    const auto found = delays.find(sequence);
    return found == delays.end() ? display::Nanoseconds{0} : found->second;
  }
  [[nodiscard]] display::EventFate fate(uint64_t sequence) noexcept override {
    const auto found = fates.find(sequence);
    return found == fates.end() ? otherwise : found->second;
  }
};

}  // namespace lenticule::test
