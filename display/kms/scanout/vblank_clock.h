// SPDX-License-Identifier: Apache-2.0
// The vblanks of one lit output: by its driver's count, or by time where the driver does not count.
// Places flips on them, and tells those that somebody asked for.
#pragma once

#include <cstdint>
#include <optional>

#include "display/clock.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/vblank_counter.h"

namespace lenticule::display {

/// Less than the 250 ms after which a player takes a flip for landed.
[[nodiscard]] Nanoseconds flip_patience(Nanoseconds period) noexcept;

/// One thread. Borrows everything that it is made with.
class VblankClock {
 public:
  VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock, KmsCounters& counters);

  [[nodiscard]] bool is_hardware() const noexcept {
    return counter_.source() == VblankCounter::Source::Hardware;
  }
  [[nodiscard]] Nanoseconds period() const noexcept { return counter_.period(); }
  /// After a modeset the driver may count anew.
  void rebase() { counter_.rebase(clock_.now()); }

  /// Where a flip landed, and when it may be reported: by the driver's count at once, by ours when
  /// its tick comes. No two flips share a vblank, whatever the driver says.
  struct Landing {
    Vblank vblank{};
    Nanoseconds report_at{0};
  };
  [[nodiscard]] Landing place(const DrmEvent& flip) noexcept;
  /// Of a flip that was waited for, without an event.
  [[nodiscard]] Landing place_now() noexcept;

  /// Asks for the first vblank after `sequence`. `serial` comes back in the driver's event, if the
  /// driver is asked at all: while the output is off it does not count, then time does.
  void request(uint64_t sequence, uint64_t serial, bool may_ask_driver) noexcept;
  /// False if nobody waits for this event.
  [[nodiscard]] bool observe(const DrmEvent& tick) noexcept;
  /// When the vblank that was asked for is overdue or, counted by time, there; never without one.
  [[nodiscard]] Nanoseconds due() const noexcept;
  void run_timers() noexcept;
  /// The vblank that was asked for, once.
  [[nodiscard]] std::optional<Vblank> take_tick() noexcept;

 private:
  struct Tick {
    enum class Phase { None, Awaited, Timed, Ready };
    Phase phase = Phase::None;
    uint64_t sequence = 0;
    uint64_t serial = 0;
    Nanoseconds due{0};
    Vblank vblank{};
  };
  struct Start {
    VblankCounter::Source source;
    Vblank vblank;
  };
  [[nodiscard]] static Start first_reading(const KmsOutput& output, Nanoseconds now);

  void watch_sequences(uint64_t sequence) noexcept;
  [[nodiscard]] Landing place_at(Vblank vblank) noexcept;

  VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock, KmsCounters& counters,
              Start start);

  const KmsOutput& output_;
  Clock& clock_;
  KmsCounters& counters_;
  VblankCounter counter_;
  Tick tick_;
  uint64_t last_flip_sequence_ = 0;
  uint64_t last_driver_sequence_ = 0;
  int same_sequences_ = 0;
};

}  // namespace lenticule::display
