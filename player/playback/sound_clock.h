// SPDX-License-Identifier: Apache-2.0
// SoundClock tells the sound which picture is due when, by the panel's clock. The presenter writes
// it at every flip, and the sound follows; docs/play/sound.md.
#pragma once

#include <cstdint>
#include <functional>

#include "base/live_value.h"
#include "display/display.h"

namespace lenticule::player {

inline constexpr double kLeastVolumeDb = -80.0, kMostVolumeDb = 12.0;  ///< the least is silence

/// A frame of an item and its ideal time, which the cadence moves by less than a vblank.
struct SoundAnchor {
  uint64_t item = 0;          ///< item number that the source gives
  uint64_t number = 0;        ///< number of the frame within the item
  uint64_t round = 0;         ///< times that the item began again
  uint64_t round_frames = 0;  ///< frames of the longest round so far; 0: there was none
  uint64_t due_ns = 0;        ///< display clock; 0: nothing was shown yet
  uint64_t begun_ns = 0;      ///< time at which the item's turn began
  uint64_t cut = 0;           ///< discontinuity number of the source
  uint64_t numerator = 0;     ///< rate at which frames follow, as played
  uint64_t denominator = 0;
  uint64_t held = 1;  ///< 1: paused, or switched off
};

struct SoundClock {
  LiveValue<SoundAnchor> anchor;
  /// Called by the presenter in simulated time, where no other thread can follow it. Null
  /// otherwise.
  std::function<void(display::Nanoseconds now)> advance = nullptr;
};

}  // namespace lenticule::player
