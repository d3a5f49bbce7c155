// SPDX-License-Identifier: Apache-2.0
// The one flip that was accepted and not yet reported: how far it is, and when something is due.
// Asks nothing of the kernel itself.
#pragma once

#include <cstdint>

#include "display/kms/scanout/scanout_pool.h"
#include "display/kms/scanout/vblank_counter.h"

namespace lenticule::display {

/// "Never" among times at which something is due.
inline constexpr Nanoseconds kNever = Nanoseconds::max();

/// One thread.
class PendingFlip {
 public:
  enum class Phase {
    None,
    Queued,  ///< to be committed when due
    Armed,   ///< committed: its event is awaited until due
    Stuck,   ///< to be shown by a blocking commit when due
    Landed,  ///< on the glass, to be reported when due
  };

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Null without a flip.
  [[nodiscard]] KmsBuffer* buffer() const noexcept { return buffer_; }
  /// kNever without a flip.
  [[nodiscard]] Nanoseconds due() const noexcept { return due_; }
  [[nodiscard]] bool is_due(Phase phase, Nanoseconds now) const noexcept {
    return phase_ == phase && now >= due_;
  }
  /// Accepted, and not on the glass yet.
  [[nodiscard]] bool under_way() const noexcept {
    return phase_ == Phase::Queued || phase_ == Phase::Armed || phase_ == Phase::Stuck;
  }
  /// Whether the event with this number is the one that is awaited.
  [[nodiscard]] bool awaits(uint64_t serial) const noexcept {
    return phase_ == Phase::Armed && serial_ == serial;
  }

  /// None -> Queued, due at once. `id` is the caller's.
  void queue(KmsBuffer* buffer, uint64_t id) noexcept;
  /// Back to None: it was not accepted after all.
  void withdraw() noexcept { *this = PendingFlip{}; }
  /// Queued -> Armed; `serial` is what the event will carry.
  void arm(uint64_t serial, Nanoseconds patience_ends) noexcept;
  /// The kernel was busy: tried again, or Stuck when that happens too often.
  void put_off(Nanoseconds until) noexcept;
  /// Queued, Armed or Stuck -> Stuck; otherwise nothing.
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
