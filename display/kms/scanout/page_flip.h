// SPDX-License-Identifier: Apache-2.0
// PendingFlip and TileEvents are the state of one page flip, without kernel calls.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "display/clock.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/vblank_clock.h"

namespace lenticule::display {

/// PendingFlip is the state of the one flip that was accepted and not yet reported, and the time of
/// its next step. It makes no kernel calls. Thread safety: one thread.
class PendingFlip {
 public:
  static constexpr int kRefusalsBeforeStuck = 5;
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
  void queue(KmsBuffer* buffer, uint64_t id) noexcept {
    *this = PendingFlip{};
    phase_ = Phase::Queued;
    buffer_ = buffer;
    id_ = id;
    due_ = Nanoseconds{0};
  }
  /// Back to None: the flip was not accepted after all.
  void withdraw() noexcept { *this = PendingFlip{}; }
  /// Queued -> Armed; the event will carry `serial`.
  void arm(uint64_t serial, Nanoseconds timeout_end) noexcept {
    phase_ = Phase::Armed;
    serial_ = serial;
    due_ = timeout_end;
    refusals_ = 0;
  }
  /// Tries again at `until` because the kernel was busy; changes to Stuck after too many refusals.
  void put_off(Nanoseconds until) noexcept {
    phase_ = ++refusals_ > kRefusalsBeforeStuck ? Phase::Stuck : Phase::Queued;
    due_ = until;
  }
  /// Queued, Armed or Stuck -> Stuck; no effect in other phases.
  void stick(Nanoseconds due) noexcept {
    if (!under_way()) return;
    phase_ = Phase::Stuck;
    due_ = due;
  }
  void land(Vblank vblank, Nanoseconds report_at) noexcept {
    phase_ = Phase::Landed;
    vblank_ = vblank;
    due_ = report_at;
  }

  struct Landed {
    KmsBuffer* buffer = nullptr;
    uint64_t id = 0;
    Vblank vblank{};
  };
  /// Landed -> None.
  [[nodiscard]] Landed deliver() noexcept {
    const Landed landed{.buffer = buffer_, .id = id_, .vblank = vblank_};
    *this = PendingFlip{};
    return landed;
  }

 private:
  Phase phase_ = Phase::None;
  KmsBuffer* buffer_ = nullptr;
  uint64_t id_ = 0;
  uint64_t serial_ = 0;
  Nanoseconds due_ = kNever;
  int refusals_ = 0;
  Vblank vblank_{};
};

/// TileEvents collects the events of one flip, of which each CRTC sends one. Thread safety: one
/// thread.
class TileEvents {
 public:
  explicit TileEvents(size_t tiles) : arrived_(tiles) {}

  /// Forgets the events of the previous flip.
  void start() noexcept {
    for (std::optional<DrmEvent>& event : arrived_) event.reset();
  }
  /// Adds the event of a tile. Returns false if that tile's event has arrived already.
  [[nodiscard]] bool add(size_t tile, const DrmEvent& event) noexcept {
    if (arrived_[tile]) return false;
    arrived_[tile] = event;
    return true;
  }
  [[nodiscard]] bool complete() const noexcept {
    return std::ranges::all_of(arrived_, [](const auto& event) { return event.has_value(); });
  }
  /// Returns the event of the first tile, which must have arrived.
  [[nodiscard]] const DrmEvent& first() const noexcept { return *arrived_.front(); }
  /// Returns the difference between the earliest and the latest vblank of a complete flip; 0 if the
  /// driver does not state times.
  [[nodiscard]] Nanoseconds skew() const noexcept {
    const auto [first, last] = std::ranges::minmax(
        arrived_, {}, [](const std::optional<DrmEvent>& event) { return event->time; });
    return first->time > Nanoseconds{0} ? last->time - first->time : Nanoseconds{0};
  }

 private:
  std::vector<std::optional<DrmEvent>> arrived_;
};

}  // namespace lenticule::display
