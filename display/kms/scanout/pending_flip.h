// SPDX-License-Identifier: Apache-2.0
// PendingFlip is the state of the one flip that was accepted and not yet reported, and the time of
// its next step. It makes no kernel calls.
#pragma once

#include <cstdint>

#include "display/kms/scanout/scanout_pool.h"
#include "display/kms/scanout/vblank_counter.h"

namespace lenticule::display {

/// The value "never" for due times.
inline constexpr Nanoseconds kNever = Nanoseconds::max();

/// Thread safety: one thread.
class PendingFlip {
 public:
  enum class Phase {
    None,
    Queued,  ///< waits to be committed when due
    Armed,   ///< committed; its event is awaited until due
    Stuck,   ///< waits to be shown by a blocking commit when due
    Landed,  ///< displayed; to be reported when due
  };

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Returns the buffer; null without a flip.
  [[nodiscard]] KmsBuffer* buffer() const noexcept { return buffer_; }
  /// Returns the time of the next step; kNever without a flip.
  [[nodiscard]] Nanoseconds due() const noexcept { return due_; }
  [[nodiscard]] bool is_due(Phase phase, Nanoseconds now) const noexcept {
    return phase_ == phase && now >= due_;
  }
  /// Returns true if the flip is accepted and not displayed yet.
  [[nodiscard]] bool under_way() const noexcept {
    return phase_ == Phase::Queued || phase_ == Phase::Armed || phase_ == Phase::Stuck;
  }
  /// Returns true if the event with this number is the awaited one.
  [[nodiscard]] bool awaits(uint64_t serial) const noexcept {
    return phase_ == Phase::Armed && serial_ == serial;
  }

  /// None -> Queued, due at once. `id` is the caller's.
  void queue(KmsBuffer* buffer, uint64_t id) noexcept;
  /// Back to None: the flip was not accepted after all.
  void withdraw() noexcept { *this = PendingFlip{}; }
  /// Queued -> Armed; the event will carry `serial`.
  void arm(uint64_t serial, Nanoseconds patience_ends) noexcept;
  /// Tries again at `until` because the kernel was busy; changes to Stuck after too many refusals.
  void put_off(Nanoseconds until) noexcept;
  /// Queued, Armed or Stuck -> Stuck; no effect in other phases.
  void stick(Nanoseconds due) noexcept;
  void land(Vblank vblank, Nanoseconds report_at) noexcept;

  struct Landed {
    KmsBuffer* buffer = nullptr;
    uint64_t id = 0;
    Vblank vblank{};
  };
  /// Landed -> None.
  [[nodiscard]] Landed deliver() noexcept;

 private:
  Phase phase_ = Phase::None;
  KmsBuffer* buffer_ = nullptr;
  uint64_t id_ = 0;
  uint64_t serial_ = 0;
  Nanoseconds due_ = kNever;
  int refusals_ = 0;
  Vblank vblank_{};
};

}  // namespace lenticule::display
