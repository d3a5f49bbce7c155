// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_peer.h"

namespace lenticule::player {

using std::chrono::nanoseconds;

/// Two StepClocks differ by the steps that each has left out, as long as both machines' clocks are
/// right. If one of them was just set wrong, the previous difference still holds.
StepVerdict StepPeer::judge(const StepMessage& message, const StepNow& now) noexcept {
  const bool same = heard_ && message.session == last_.session;
  if (!same && alive(now)) return StepVerdict::Stranger;
  const nanoseconds after_last = same ? message.sent - last_.sent
                                      : message.sent + message.stepped - last_.sent - last_.stepped;
  if (heard_ && after_last <= nanoseconds{0}) return StepVerdict::Replayed;

  const nanoseconds by_real_time = now.stepped - message.stepped;
  nanoseconds ahead = by_real_time;
  age_ = now.group + ahead - message.sent;
  if (!timely(age_)) {
    ahead = same ? ahead_ : nanoseconds{0};
    const nanoseconds age = now.group + ahead - message.sent;
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
  if (!last_.timeline) return std::nullopt;
  return last_.timeline->on_clock_ahead_by(-ahead_);
}

}  // namespace lenticule::player
