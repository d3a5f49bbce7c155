// SPDX-License-Identifier: Apache-2.0
// Opens a display without hardware: it has its own vblank clock and scan-out buffers in ordinary
// memory.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "display/clock.h"
#include "display/display.h"
#include "display/scanout_format.h"
#include "display/scanout_recorder.h"

namespace lenticule::display {

enum class EventFate {
  Deliver,
  Drop,       ///< the flip happens, without an event
  Duplicate,  ///< the event is delivered twice
  Unplug,     ///< the display is lost from this vblank on
};

/// VirtualFaults injects faults into a virtual display that real displays also have. Asked once per
/// event, on the presenter thread. The defaults describe a perfect display.
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

struct VirtualDisplayOptions {
  frames::FrameGeometry geometry = {};  ///< scan-out memory; its frames may be turned
  optics::Mounting mounting = {};
  ScanoutDepth depth = ScanoutDepth::Bits8;
  std::vector<ScanoutPart> parts = {};  ///< the panels of a wall; empty for one panel
  frames::Rate refresh{60, 1};
  /// 2 ... 16: one displayed, one pending, the others filled ahead.
  int buffers = 3;
  /// Null = real time.
  std::shared_ptr<Clock> clock = nullptr;
  /// Null = no faults.
  std::shared_ptr<VirtualFaults> faults = nullptr;
  /// Null = no recording. In real time, recording has its own thread and 2 to 64 additional buffers
  /// (64 MiB if that is more than two). A frame that finds all of them busy is counted instead of
  /// recorded, so that recording never disturbs pacing. In simulated time, recording runs inside
  /// wait_event() and skips no frame.
  std::shared_ptr<ScanoutRecorder> recorder = nullptr;
};

/// Opens a virtual display. A flip submitted at time t is displayed from the first vblank after t.
/// Vblank 0 is the time of opening. The destructor records the frames that are still queued.
///
/// Throws Error(Usage) for options out of range and Error(Failed) if the buffers would take more
/// than half of the free memory.
[[nodiscard]] std::unique_ptr<Display> open_virtual_display(const VirtualDisplayOptions& options);

}  // namespace lenticule::display
