// SPDX-License-Identifier: Apache-2.0
// Brings frames onto the glass of one lit output and keeps them there: repeats what the kernel was
// too busy for, replaces lost events by blocking commits and those by modesets, and pauses while
// the card belongs to another session.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "display/clock.h"
#include "display/display.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/device/session.h"
#include "display/kms/scanout/commit_failure.h"
#include "display/kms/scanout/kms_counters.h"
#include "display/kms/scanout/lit_output.h"
#include "display/kms/scanout/pending_flip.h"
#include "display/kms/scanout/vblank_clock.h"

namespace lenticule::display {

/// The presenter thread's. Allocates nothing except for modesets.
class FlipEngine final : private DrmEventHandler {
 public:
  /// Borrows `lit`, whose front it keeps up to date, and `counters`.
  FlipEngine(LitOutput& lit, std::shared_ptr<Session> session, std::shared_ptr<Clock> clock,
             frames::Rate refresh, KmsCounters& counters);

  /// As Display::submit() and request_vblank().
  [[nodiscard]] SubmitStatus submit(KmsBuffer* buffer, uint64_t id) noexcept;
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept;
  /// What is to be reported by now, one at a time.
  [[nodiscard]] std::optional<DisplayEvent> take_event() noexcept;

  /// When run_timers() has something to do, or take_event() something to report.
  [[nodiscard]] Nanoseconds next_due() const noexcept;
  void run_timers() noexcept;
  /// The card's descriptor is readable.
  void read_events() noexcept;
  /// The seat's keeper took the card away or gave it back.
  void set_session_ours(bool ours) noexcept;

  /// The output may be in any state: a modeset, which also shows the flip under way, if there is
  /// one.
  void relight_soon() noexcept;
  /// The card, or the right to use this panel, is gone for good.
  void lose() noexcept { lost_ = true; }
  [[nodiscard]] bool lost() const noexcept { return lost_; }
  [[nodiscard]] bool counts_by_hardware() const noexcept { return vblanks_.is_hardware(); }
  /// True once after something that a change of the panel would explain.
  [[nodiscard]] bool take_doubt() noexcept;

 private:
  void on_drm_event(const DrmEvent& event) noexcept override;
  void on_flip_event(const DrmEvent& event) noexcept;
  void try_flip() noexcept;
  void land(VblankClock::Landing landing) noexcept;
  DisplayEvent deliver_flip() noexcept;

  /// Counts a refusal, and does what it asks for wherever it comes from.
  CommitFailure note_failure(int error) noexcept;
  void recover() noexcept;
  void recovered() noexcept;
  [[nodiscard]] int relight() noexcept;
  void recover_at(Nanoseconds when) noexcept;
  void pause() noexcept;
  void try_resume() noexcept;

  [[nodiscard]] Nanoseconds now() const noexcept { return clock_->now(); }
  /// A modeset is due though no flip waits for it.
  [[nodiscard]] bool only_modeset_pending() const noexcept {
    return needs_modeset_ && !flip_.under_way();
  }
  [[nodiscard]] uint32_t wanted_on_glass() const noexcept {
    return (flip_.buffer() != nullptr ? flip_.buffer() : lit_.front)->framebuffer();
  }

  LitOutput& lit_;
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
