// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_peer.h"

namespace lenticule::player {

using std::chrono::nanoseconds;

/// Returns true if a newer message is known: of the same session, or of an accepted earlier one.
bool StepPeer::is_copy(const StepMessage& message) const noexcept {
  if (newest_ && newest_->session == message.session && message.sent <= newest_->sent) return true;
  return heard_ && message.session != last_.session &&
         message.sent + message.stepped <= last_.sent + last_.stepped;
}

/// Two StepClocks differ by the steps that each has left out, as long as both machines' clocks are
/// right. If one of them was just set wrong, the previous difference still holds.
///
/// If this machine's clock was wrong from the start, old copies can look fresh, and fresh messages
/// seem to come from the future. So untimely messages are remembered, too, and one from the future
/// shows that an accepted message of its session was a copy.
StepVerdict StepPeer::judge(const StepMessage& message, const StepNow& now) noexcept {
  const bool same = heard_ && message.session == last_.session;
  if (!same && alive(now)) return StepVerdict::Stranger;
  if (is_copy(message)) return StepVerdict::Replayed;
  newest_ = {.session = message.session, .sent = message.sent, .at = now.monotonic};

  const nanoseconds by_real_time = now.stepped - message.stepped;
  nanoseconds ahead = by_real_time;
  age_ = now.group + ahead - message.sent;
  if (!timely(age_)) {
    ahead = same ? ahead_ : nanoseconds{0};
    const nanoseconds age = now.group + ahead - message.sent;
    if (same && age < -kOldest) heard_ = false;
    if (!timely(age)) return StepVerdict::Untimely;
    age_ = age;
  }
  ahead_ = ahead;
  heard_ = true;
  heard_at_ = now.monotonic;
  last_ = message;
  return StepVerdict::Accepted;
}

std::optional<StepTimeline> StepPeer::timeline() const noexcept {
  if (!heard_ || !last_.timeline) return std::nullopt;
  return last_.timeline->on_clock_ahead_by(-ahead_);
}

}  // namespace lenticule::player
