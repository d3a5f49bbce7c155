// SPDX-License-Identifier: Apache-2.0
// FlipEngine flips frames on one active output. It repeats commits for which the kernel was busy,
// replaces lost events by blocking commits and failed ones by modesets, and pauses while another
// session owns the card.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/device/session.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/commit_failure.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/pending_flip.h"
#include "display/kms/scanout/vblank_clock.h"

namespace lenticule::display {

/// Allocates memory only for modesets. Thread safety: the presenter's thread.
class FlipEngine final : private DrmEventHandler {
 public:
  /// Lifetime: `active`, whose front buffer the engine keeps up to date, and `counters` must
  /// outlive the engine.
  FlipEngine(ActiveOutput& active, std::shared_ptr<Session> session, std::shared_ptr<Clock> clock,
             frames::Rate refresh, KmsCounters& counters);

  /// See Display::submit() and request_vblank().
  [[nodiscard]] SubmitStatus submit(KmsBuffer* buffer, uint64_t id) noexcept;
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept;
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
  void relight_soon() noexcept;
  /// Marks the display as lost: the card, or the right to use this panel, is gone permanently.
  void lose() noexcept { lost_ = true; }
  [[nodiscard]] bool lost() const noexcept { return lost_; }
  [[nodiscard]] bool counts_by_hardware() const noexcept { return vblanks_.is_hardware(); }
  /// Returns true once after a failure that a change of the panel could explain.
  [[nodiscard]] bool take_doubt() noexcept;

 private:
  void on_drm_event(const DrmEvent& event) noexcept override;
  void on_flip_event(const DrmEvent& event) noexcept;
  void try_flip() noexcept;
  void land(VblankClock::Landing landing) noexcept;
  DisplayEvent deliver_flip() noexcept;

  /// Counts a refusal and starts the reaction that it needs.
  CommitFailure note_failure(int error) noexcept;
  void recover() noexcept;
  void recovered() noexcept;
  [[nodiscard]] int relight() noexcept;
  void recover_at(Nanoseconds when) noexcept;
  void pause() noexcept;
  void try_resume() noexcept;

  [[nodiscard]] Nanoseconds now() const noexcept { return clock_->now(); }
  /// Returns true if a modeset is due without a pending flip.
  [[nodiscard]] bool only_modeset_pending() const noexcept {
    return needs_modeset_ && !flip_.under_way();
  }
  [[nodiscard]] uint32_t wanted_on_glass() const noexcept {
    return (flip_.buffer() != nullptr ? flip_.buffer() : active_.front)->framebuffer();
  }

  ActiveOutput& active_;
  std::shared_ptr<Session> session_;
  std::shared_ptr<Clock> clock_;
  KmsCounters& counters_;
  VblankClock vblanks_;
  PendingFlip flip_;
  uint64_t next_serial_;

  int recovery_attempts_ = 0;
  Nanoseconds backoff_;
  bool needs_modeset_ = false;
  Nanoseconds recover_at_{0};
  bool panel_in_doubt_ = false;
  bool lost_ = false;
  bool paused_ = false;
  Nanoseconds resume_at_ = kNever;
  Nanoseconds resume_backoff_;
};

}  // namespace lenticule::display
