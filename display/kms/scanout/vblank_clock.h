// SPDX-License-Identifier: Apache-2.0
// VblankClock counts the vblanks of one active output, by the driver's counter or, if the driver
// has none, by time. It assigns flips to vblanks and reports requested vblanks.
#pragma once

#include <cstdint>
#include <optional>

#include "display/clock.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/vblank_counter.h"

namespace lenticule::display {

/// Returns the timeout of a flip, less than the 250 ms after which a player assumes that a flip
/// completed.
[[nodiscard]] Nanoseconds flip_patience(Nanoseconds period) noexcept;

/// Thread safety: one thread. Lifetime: all arguments of the constructor must outlive the object.
class VblankClock {
 public:
  VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock, KmsCounters& counters);

  [[nodiscard]] bool is_hardware() const noexcept {
    return counter_.source() == VblankCounter::Source::Hardware;
  }
  [[nodiscard]] Nanoseconds period() const noexcept { return counter_.period(); }
  /// Call after a modeset, which may reset the driver's counter.
  void rebase() { counter_.rebase(clock_.now()); }

  /// The vblank of a flip, and the time when the flip may be reported: immediately for the driver's
  /// counter, at the vblank's time otherwise. Two flips never share a vblank, even if the driver
  /// reports that.
  struct Landing {
    Vblank vblank{};
    Nanoseconds report_at{0};
  };
  [[nodiscard]] Landing place(const DrmEvent& flip) noexcept;
  /// Returns the landing of a flip that was completed by a blocking commit, without an event.
  [[nodiscard]] Landing place_now() noexcept;

  /// Requests the first vblank after `sequence`. The driver's event, if the driver is asked,
  /// carries `serial`. While the output is off the driver does not count, so time is used instead.
  void request(uint64_t sequence, uint64_t serial, bool may_ask_driver) noexcept;
  /// Handles a vblank event; returns false if it was not requested.
  [[nodiscard]] bool observe(const DrmEvent& tick) noexcept;
  /// Returns the time at which the requested vblank is overdue or, counted by time, reached; never
  /// without a request.
  [[nodiscard]] Nanoseconds due() const noexcept;
  void run_timers() noexcept;
  /// Returns the requested vblank once.
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
