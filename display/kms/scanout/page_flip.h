// SPDX-License-Identifier: Apache-2.0
// PageFlipHandler flips frames on one active output. It repeats commits for which the kernel was
// busy, replaces lost events by blocking commits and failed ones by modesets, and pauses while
// another session owns the card or the output is switched off.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/device/platform.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/kms_output.h"
#include "display/kms/scanout/vblank_clock.h"

namespace lenticule::display {

/// PendingFlip is the state of the one flip that was accepted and not yet reported, and the time of
/// its next step. It makes no kernel calls. Thread safety: one thread.
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
  void arm(uint64_t serial, Nanoseconds timeout_end) noexcept;
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
  [[nodiscard]] bool add(size_t tile, const DrmEvent& event) noexcept;
  [[nodiscard]] bool complete() const noexcept;
  /// Returns the event of the first tile, which must have arrived.
  [[nodiscard]] const DrmEvent& first() const noexcept { return *arrived_.front(); }
  /// Returns the difference between the earliest and the latest vblank of a complete flip; 0 if the
  /// driver does not state times.
  [[nodiscard]] Nanoseconds skew() const noexcept;

 private:
  std::vector<std::optional<DrmEvent>> arrived_;
};

/// The reasons for which the kernel refuses a commit, by the reaction that each needs.
enum class CommitFailure {
  Busy,    ///< a commit is pending: try again later
  Denied,  ///< another process is DRM master at the moment: wait
  Gone,    ///< the card is gone
  Wrong,   ///< the output's state is not the expected one
};

/// Allocates memory only for modesets. Thread safety: the presenter's thread.
class PageFlipHandler final : private DrmEventHandler {
 public:
  /// Lifetime: `active`, whose front buffer the handler keeps up to date, and `counters` must
  /// outlive the handler.
  PageFlipHandler(ActiveOutput& active, std::shared_ptr<Session> session,
                  std::shared_ptr<Clock> clock, frames::Rate refresh, KmsCounters& counters);

  /// See Display::submit() and request_vblank().
  [[nodiscard]] SubmitStatus submit(KmsBuffer* buffer, uint64_t id) noexcept;
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept;
  /// See Display::set_power(). Switching on is a modeset, with a new audit; if the kernel refuses
  /// it, it is tried again like any other. A modeset that is needed while the output is off waits.
  [[nodiscard]] bool set_power(bool on) noexcept;
  /// Returns the next event that is due, one per call.
  [[nodiscard]] std::optional<DisplayEvent> take_event() noexcept;

  /// Returns the time at which run_timers() or take_event() is due.
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  void run_timers() noexcept;
  /// Call when the card's descriptor is readable.
  void read_events() noexcept;
  /// Call when the seat manager took the card away or gave it back.
  void set_session_ours(bool ours) noexcept;

  /// Requests a modeset, because the output may be in any state. The modeset also shows the pending
  /// flip, if there is one.
  void request_modeset() noexcept;
  /// Marks the display as lost: the card, or the right to use this panel, is gone permanently.
  void mark_lost() noexcept { lost_ = true; }
  [[nodiscard]] bool lost() const noexcept { return lost_; }
  [[nodiscard]] bool counts_by_hardware() const noexcept { return vblanks_.is_hardware(); }
  /// Returns true once after a failure that a change of the panel could explain: the panel should
  /// be checked.
  [[nodiscard]] bool take_panel_check() noexcept;

 private:
  void on_drm_event(const DrmEvent& event) noexcept override;
  void on_flip_event(const DrmEvent& event) noexcept;
  [[nodiscard]] bool note_tile(const DrmEvent& event) noexcept;
  void try_flip() noexcept;
  void land(VblankClock::Landing landing) noexcept {
    flip_.land(landing.vblank, landing.report_at);
  }
  DisplayEvent deliver_flip() noexcept;

  /// Counts a refusal and starts the reaction that it needs.
  CommitFailure note_failure(int error) noexcept;
  void recover() noexcept;
  void recovered() noexcept;
  [[nodiscard]] int set_mode() noexcept;
  void recover_at(Nanoseconds when) noexcept;
  void pause() noexcept;
  void try_resume() noexcept;

  [[nodiscard]] Nanoseconds now() const noexcept { return clock_->now(); }
  /// Returns true if a modeset is due without a pending flip.
  [[nodiscard]] bool only_modeset_pending() const noexcept {
    return needs_modeset_ && !off_ && !flip_.under_way();
  }
  [[nodiscard]] uint32_t wanted_on_panel() const noexcept {
    return (flip_.buffer() != nullptr ? flip_.buffer() : active_.front)->framebuffer();
  }

  ActiveOutput& active_;
  std::shared_ptr<Session> session_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  VblankClock vblanks_;
  PendingFlip flip_;
  uint64_t next_serial_;
  TileEvents tiles_;

  int recovery_attempts_ = 0;
  Nanoseconds backoff_;
  bool needs_modeset_ = false;
  Nanoseconds recover_at_{0};
  bool panel_check_due_ = false;
  bool lost_ = false;
  bool off_ = false;
  bool paused_ = false;
  Nanoseconds resume_at_ = kNever;
  Nanoseconds resume_backoff_;
};

}  // namespace lenticule::display
