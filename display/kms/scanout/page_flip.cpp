// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/page_flip.h"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace lenticule::display {
namespace {

using std::chrono::milliseconds;

constexpr int kRefusalsBeforeStuck = 5;
constexpr int kBlockingCommitsBeforeModeset = 2;
constexpr Nanoseconds kShortestBackoff = milliseconds(50);
constexpr Nanoseconds kLongestBackoff = std::chrono::seconds(1);
constexpr Nanoseconds kFirstResume = milliseconds(100);
constexpr Nanoseconds kLongestResume = std::chrono::seconds(2);

/// Returns the class of `error`, a negative errno.
CommitFailure classify(int error) noexcept {
  switch (-error) {
    case EBUSY:
      return CommitFailure::Busy;
    case EACCES:
    case EPERM:
      return CommitFailure::Denied;
    case ENODEV:
    case EIO:
    case ENXIO:
    case EBADF:
      return CommitFailure::Gone;
    default:
      return CommitFailure::Wrong;
  }
}

}  // namespace

// --- PendingFlip ----------------------------------------------------------------------------

void PendingFlip::queue(KmsBuffer* buffer, uint64_t id) noexcept {
  *this = PendingFlip{};
  phase_ = Phase::Queued;
  buffer_ = buffer;
  id_ = id;
  due_ = Nanoseconds{0};
}

void PendingFlip::arm(uint64_t serial, Nanoseconds timeout_end) noexcept {
  phase_ = Phase::Armed;
  serial_ = serial;
  due_ = timeout_end;
  refusals_ = 0;
}

void PendingFlip::put_off(Nanoseconds until) noexcept {
  phase_ = ++refusals_ > kRefusalsBeforeStuck ? Phase::Stuck : Phase::Queued;
  due_ = until;
}

void PendingFlip::stick(Nanoseconds due) noexcept {
  if (!under_way()) return;
  phase_ = Phase::Stuck;
  due_ = due;
}

void PendingFlip::land(Vblank vblank, Nanoseconds report_at) noexcept {
  phase_ = Phase::Landed;
  vblank_ = vblank;
  due_ = report_at;
}

PendingFlip::Landed PendingFlip::deliver() noexcept {
  const Landed landed{.buffer = buffer_, .id = id_, .vblank = vblank_};
  *this = PendingFlip{};
  return landed;
}

// --- TileEvents -----------------------------------------------------------------------------

bool TileEvents::add(size_t tile, const DrmEvent& event) noexcept {
  if (arrived_[tile]) return false;
  arrived_[tile] = event;
  return true;
}

bool TileEvents::complete() const noexcept {
  return std::ranges::all_of(arrived_, [](const auto& event) { return event.has_value(); });
}

Nanoseconds TileEvents::skew() const noexcept {
  const auto [first, last] = std::ranges::minmax(
      arrived_, {}, [](const std::optional<DrmEvent>& event) { return event->time; });
  return first->time > Nanoseconds{0} ? last->time - first->time : Nanoseconds{0};
}

// --- PageFlipHandler: construction ----------------------------------------------------------

PageFlipHandler::PageFlipHandler(ActiveOutput& active, std::shared_ptr<Session> session,
                                 std::shared_ptr<Clock> clock, frames::Rate refresh,
                                 KmsCounters& counters)
    : active_(active),
      session_(std::move(session)),
      clock_(std::move(clock)),
      counters_(counters),
      vblanks_(*active.output, refresh, *clock_, counters),
      // The start value differs from the serial numbers of a previous user of the card.
      next_serial_(static_cast<uint64_t>(clock_->now().count()) | 1),
      tiles_(active.output->pipe_count()),
      backoff_(kShortestBackoff),
      resume_backoff_(kFirstResume) {}

// --- events and timers ----------------------------------------------------------------------

std::optional<DisplayEvent> PageFlipHandler::take_event() noexcept {
  if (flip_.is_due(PendingFlip::Phase::Landed, now())) return deliver_flip();
  if (const auto tick = vblanks_.take_tick())
    return DisplayEvent{.kind = EventKind::Vblank, .sequence = tick->sequence, .time = tick->time};
  return std::nullopt;
}

Nanoseconds PageFlipHandler::next_due() const noexcept {
  Nanoseconds next = vblanks_.due();
  const bool flips = !paused_ && !off_;
  if (flip_.phase() == PendingFlip::Phase::Landed || flips) next = std::min(next, flip_.due());
  if (paused_) return std::min(next, resume_at_);
  if (only_modeset_pending()) next = std::min(next, recover_at_);
  return next;
}

void PageFlipHandler::run_timers() noexcept {
  using enum PendingFlip::Phase;
  if (paused_ && now() >= resume_at_) try_resume();
  if (!paused_ && !off_ && !lost_) {
    if (flip_.is_due(Queued, now())) try_flip();
    if (flip_.is_due(Armed, now())) {
      counters_.flip_timeouts.add();
      flip_.stick(now());
    }
    if (flip_.is_due(Stuck, now()) || (only_modeset_pending() && now() >= recover_at_)) recover();
  }
  vblanks_.run_timers();
}

void PageFlipHandler::read_events() noexcept {
  const EventRead result = read_drm_events(active_.output->device().fd(), *this);
  if (result == EventRead::Truncated) counters_.truncated_reads.add();
  if (result == EventRead::Gone) mark_lost();
}

void PageFlipHandler::on_drm_event(const DrmEvent& event) noexcept {
  if (event.kind == DrmEvent::Kind::Flip) return on_flip_event(event);
  if (!vblanks_.observe(event)) counters_.stray_events.add();
}

bool PageFlipHandler::take_panel_check() noexcept {
  return std::exchange(panel_check_due_, false);
}

// --- flips ----------------------------------------------------------------------------------

SubmitStatus PageFlipHandler::submit(KmsBuffer* buffer, uint64_t id) noexcept {
  if (lost_) return SubmitStatus::Lost;
  if (paused_ || off_ || flip_.phase() == PendingFlip::Phase::Stuck) return SubmitStatus::Paused;
  if (flip_.phase() != PendingFlip::Phase::None) return SubmitStatus::Busy;

  buffer->set_state(ScanoutState::Pending);
  flip_.queue(buffer, id);
  if (needs_modeset_)
    flip_.stick(recover_at_);
  else
    try_flip();
  if (!lost_ && !paused_) return SubmitStatus::Accepted;
  buffer->set_state(ScanoutState::Acquired);
  flip_.withdraw();
  return lost_ ? SubmitStatus::Lost : SubmitStatus::Paused;
}

bool PageFlipHandler::request_vblank(uint64_t sequence) noexcept {
  if (lost_) return false;
  vblanks_.request(sequence, next_serial_++, !paused_ && !off_);
  return true;
}

bool PageFlipHandler::set_power(bool on) noexcept {
  if (on != off_) return true;
  if (on) {
    off_ = false;
    request_modeset();
    if (!paused_ && !lost_) recover();
  } else {
    // While another session owns the card, the output is switched off when the card is back.
    if (lost_ || (!paused_ && active_.output->blank() != 0)) return false;
    off_ = true;
  }
  counters_.off.store(off_, std::memory_order_relaxed);
  return true;
}

void PageFlipHandler::try_flip() noexcept {
  const uint64_t serial = next_serial_++;
  tiles_.start();
  const int error = active_.output->flip(flip_.buffer()->framebuffer(), serial);
  if (error == 0) return flip_.arm(serial, now() + flip_timeout(vblanks_.period()));
  const CommitFailure failure = note_failure(error);
  if (failure == CommitFailure::Busy) flip_.put_off(now() + vblanks_.period());
  if (failure == CommitFailure::Wrong) flip_.stick(now());
}

void PageFlipHandler::on_flip_event(const DrmEvent& event) noexcept {
  if (!flip_.awaits(event.id) || !note_tile(event)) return counters_.stray_events.add();
  if (!tiles_.complete()) return;
  recovery_attempts_ = 0;
  counters_.note_skew(tiles_.skew());
  land(vblanks_.place(tiles_.first()));
}

/// Adds the event of a flip of this output. Returns false for an event that does not belong to it.
bool PageFlipHandler::note_tile(const DrmEvent& event) noexcept {
  const auto tile = active_.output->pipe_of_crtc(event.crtc);
  return tile && tiles_.add(*tile, event);
}

DisplayEvent PageFlipHandler::deliver_flip() noexcept {
  const PendingFlip::Landed flip = flip_.deliver();
  if (active_.front != nullptr) active_.front->set_state(ScanoutState::Free);
  active_.front = flip.buffer;
  active_.front->set_state(ScanoutState::Displayed);
  counters_.flips.add();
  return {.kind = EventKind::Flip,
          .id = flip.id,
          .sequence = flip.vblank.sequence,
          .time = flip.vblank.time};
}

// --- failures and recovery ------------------------------------------------------------------

CommitFailure PageFlipHandler::note_failure(int error) noexcept {
  const CommitFailure failure = classify(error);
  switch (failure) {
    case CommitFailure::Busy:
      counters_.busy.add();
      break;
    case CommitFailure::Denied:
      counters_.denied.add();
      pause();
      break;
    case CommitFailure::Gone:
      mark_lost();
      break;
    case CommitFailure::Wrong:
      counters_.refused.add();
      needs_modeset_ = true;
      break;
  }
  return failure;
}

/// Recovers a flip whose event is missing. A blocking commit returns when the frame is displayed,
/// so its success replaces the lost event. If blocking commits fail, a modeset is tried, and then
/// again after growing pauses.
void PageFlipHandler::recover() noexcept {
  const bool modeset = needs_modeset_ || ++recovery_attempts_ > kBlockingCommitsBeforeModeset;
  const int error = modeset ? set_mode() : active_.output->show(wanted_on_panel());
  if (error == 0) return recovered();
  const CommitFailure failure = note_failure(error);
  if (failure == CommitFailure::Wrong) panel_check_due_ = true;
  if (failure != CommitFailure::Busy && failure != CommitFailure::Wrong) return;
  recover_at(now() + backoff_);
  backoff_ = std::min(2 * backoff_, kLongestBackoff);
}

void PageFlipHandler::recovered() noexcept {
  recovery_attempts_ = 0;
  backoff_ = kShortestBackoff;
  counters_.recoveries.add();
  if (flip_.phase() == PendingFlip::Phase::Stuck) land(vblanks_.place_now());
}

int PageFlipHandler::set_mode() noexcept {
  counters_.modesets.add();
  const int error = active_.output->set_mode(wanted_on_panel());
  if (error != 0) return error;
  needs_modeset_ = false;
  vblanks_.rebase();
  return 0;
}

void PageFlipHandler::recover_at(Nanoseconds when) noexcept {
  recover_at_ = when;
  flip_.stick(when);
}

void PageFlipHandler::request_modeset() noexcept {
  needs_modeset_ = true;
  if (!paused_) recover_at(now());
}

void PageFlipHandler::pause() noexcept {
  if (paused_) return;
  paused_ = true;
  counters_.pauses.add();
  resume_backoff_ = kFirstResume;
  resume_at_ = now() + resume_backoff_;
  flip_.stick(resume_at_);
}

void PageFlipHandler::set_session_ours(bool ours) noexcept {
  if (!ours) return pause();
  if (paused_) resume_at_ = now();
}

/// Tries to resume after a pause. The output's state may have changed meanwhile, so this takes a
/// whole modeset, or switches the output off again.
void PageFlipHandler::try_resume() noexcept {
  if (session_->ensure_master(active_.output->device().fd()) == Mastership::Held) {
    const int error = off_ ? active_.output->blank() : set_mode();
    if (error == 0) {
      paused_ = false;
      resume_at_ = kNever;
      panel_check_due_ = true;
      return recovered();
    }
    if (classify(error) == CommitFailure::Gone) return mark_lost();
  }
  resume_backoff_ = std::min(2 * resume_backoff_, kLongestResume);
  resume_at_ = now() + resume_backoff_;
}

}  // namespace lenticule::display
