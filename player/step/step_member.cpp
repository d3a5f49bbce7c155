// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_member.h"

#include <sys/timex.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;

/// Two clocks are not read at the same moment; a smaller change is no step.
constexpr nanoseconds kLeastStep = std::chrono::milliseconds(1);

nanoseconds read_clock(clockid_t clock) noexcept {
  timespec time{};
  (void)::clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

}  // namespace

ClockReading read_clocks() noexcept {
  return {.monotonic = read_clock(CLOCK_MONOTONIC), .real = read_clock(CLOCK_REALTIME)};
}

StepClock::StepClock(const ClockReading& start) noexcept : ahead_(start.real - start.monotonic) {}

StepNow StepClock::now(const ClockReading& reading) noexcept {
  const nanoseconds stepped = reading.real - reading.monotonic - ahead_;
  if (std::chrono::abs(stepped - stepped_) >= kLeastStep) {
    stepped_ = stepped;
    ++steps_;
  }
  return {.monotonic = reading.monotonic, .group = reading.monotonic + ahead_, .stepped = stepped_};
}

ClockAccuracy read_clock_accuracy() noexcept {
  timex answer{};
  const int state = ::adjtimex(&answer);
  if (state < 0) return {};
  return {.known = true,
          .synchronised = state != TIME_ERROR && (answer.status & STA_UNSYNC) == 0,
          .offset_us = (answer.status & STA_NANO) != 0 ? answer.offset / 1000 : answer.offset,
          .estimated_us = answer.esterror,
          .bound_us = answer.maxerror};
}

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

namespace {

using std::chrono::nanoseconds;

/// A timeline is stated for a frame this far ahead.
constexpr nanoseconds kAhead = std::chrono::milliseconds(500);
/// A message that differs this much from this machine's clock is a recording.
constexpr nanoseconds kRecording = std::chrono::seconds(10);

/// Returns true if a player at this place can keep the timeline.
bool fits(const StepTimeline& timeline, const StepPlace& place) {
  const bool same_rate = std::abs(timeline.rate.hertz() / place.rate.hertz() - 1.0) < 0.01;
  const bool both_known = timeline.loop_frames > 0 && place.loop_frames > 0;
  return same_rate && (!both_known || timeline.loop_frames == place.loop_frames);
}

}  // namespace

// --- both roles -----------------------------------------------------------------------------

std::optional<uint64_t> StepMember::receive(std::span<const uint8_t> bytes, const StepNow& now) {
  const StepKey::Opened opened = identity_.key.open(bytes, identity_.group);
  if (!opened.message) {
    switch (opened.refusal) {
      case StepKey::Refusal::Format:
        ++counts_.refused_format;
        break;
      case StepKey::Refusal::Group:
        ++counts_.refused_group;
        break;
      case StepKey::Refusal::Key:
        ++counts_.refused_key;
        break;
    }
    return std::nullopt;
  }
  if (opened.message->kind == kind_) {
    ++counts_.refused_group;
    return std::nullopt;
  }
  StepPeer* const peer = peer_for(*opened.message, now);
  if (peer == nullptr) {
    ++counts_.refused_stranger;
    return std::nullopt;
  }
  const StepVerdict verdict = peer->judge(*opened.message, now);
  if (verdict == StepVerdict::Untimely) note_untimely(*opened.message, *peer, now);
  if (verdict == StepVerdict::Untimely || verdict == StepVerdict::Accepted) heard(*peer);
  if (!count(verdict)) return std::nullopt;
  return opened.message->session;
}

bool StepMember::count(StepVerdict verdict) {
  switch (verdict) {
    case StepVerdict::Accepted:
      ++counts_.accepted;
      return true;
    case StepVerdict::Replayed:
      ++counts_.refused_replayed;
      return false;
    case StepVerdict::Untimely:
      ++counts_.refused_untimely;
      return false;
    case StepVerdict::Stranger:
      ++counts_.refused_stranger;
      return false;
  }
  return false;
}

void StepMember::note_untimely(const StepMessage& message, const StepPeer& peer,
                               const StepNow& now) {
  untimely_age_ = peer.age();
  if (message.timeline && std::chrono::abs(peer.age()) < kRecording) disagreed_at_ = now.monotonic;
}

StepBytes StepMember::sealed(const StepPlace& place, const StepNow& now) const {
  StepMessage message{.kind = kind_,
                      .session = identity_.session,
                      .sent = now.group,
                      .stepped = now.stepped,
                      .in_step = place.in_step != 0,
                      .difference = place.difference};
  if (timeline_) message.timeline = timeline_->stated_after(now.group + kAhead);
  return identity_.key.seal(message, identity_.group);
}

// --- the leader -----------------------------------------------------------------------------

std::optional<StepBytes> StepLeader::tick(const StepPlace& place, const StepNow& now) {
  std::erase_if(followers_, [&](const auto& entry) { return !entry.second.sends(now); });
  const bool listened = now.monotonic >= began_ + kListening;
  if (!timeline_ && listened && place.started != 0) timeline_ = timeline_of_group(place, now);
  if (!timeline_) return std::nullopt;
  if (timeline_->loop_frames == 0) timeline_->loop_frames = place.loop_frames;
  return sealed(place, now);
}

/// Returns the timeline that a follower still keeps, otherwise a new one; none while the clocks
/// disagree.
std::optional<StepTimeline> StepLeader::timeline_of_group(const StepPlace& place,
                                                          const StepNow& now) const {
  for (const auto& [session, peer] : followers_)
    if (const auto kept = peer.timeline(); kept && fits(*kept, place)) return kept;
  if (clocks_disagree(now)) return std::nullopt;
  return StepTimeline{.frame = place.next_frame,
                      .due = nanoseconds(place.next_due_ns) + (now.group - now.monotonic),
                      .rate = place.rate,
                      .loop_frames = place.loop_frames};
}

size_t StepLeader::peers(const StepNow& now) const {
  return static_cast<size_t>(
      std::count_if(followers_.begin(), followers_.end(),
                    [&](const auto& entry) { return entry.second.alive(now); }));
}

bool StepLeader::alive(uint64_t session, const StepNow& now) const {
  const auto found = followers_.find(session);
  return found != followers_.end() && found->second.alive(now);
}

StepPeer* StepLeader::peer_for(const StepMessage& message, const StepNow& now) {
  const auto found = followers_.find(message.session);
  if (found != followers_.end()) return &found->second;
  if (followers_.size() >= kMaxFollowers)
    std::erase_if(followers_, [&](const auto& entry) { return !entry.second.alive(now); });
  return followers_.size() < kMaxFollowers ? &followers_[message.session] : nullptr;
}

int64_t StepLeader::apart(const StepPlace& own, const StepNow& now) const {
  std::optional<std::pair<int64_t, int64_t>> span;
  const auto add = [&](int64_t difference) {
    if (!span) span = {difference, difference};
    span->first = std::min(span->first, difference);
    span->second = std::max(span->second, difference);
  };
  if (own.in_step != 0) add(own.difference);
  for (const auto& [session, peer] : followers_)
    if (peer.alive(now) && peer.last().in_step) add(peer.last().difference);
  return span ? span->second - span->first : 0;
}

// --- a follower -----------------------------------------------------------------------------

}  // namespace lenticule::player
