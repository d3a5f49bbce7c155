// SPDX-License-Identifier: Apache-2.0
// StepLeader and StepFollower keep the timeline of a group: pure state machines that get messages
// and clock readings, and return messages. Every player, the leader too, follows the timeline.
//
// The leader states the timeline, and begins it with the frame that it shows first. A follower
// keeps the last stated timeline when the leader is gone, so the group stays in step, and reports
// it: a leader that is started again continues the group's timeline and does not begin another.
#pragma once

#include <sys/timex.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "player/step/step_message.h"
#include "player/step/step_pacing.h"

namespace lenticule::player {

struct ClockReading {
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds real{0};
};
[[nodiscard]] inline ClockReading read_clocks() noexcept {
  const auto read = [](clockid_t clock) {
    timespec time{};
    (void)::clock_gettime(clock, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  };
  return {.monotonic = read(CLOCK_MONOTONIC), .real = read(CLOCK_REALTIME)};
}

/// One moment, as messages and timelines need it.
struct StepNow {
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds group{0};    ///< time of the StepClock
  std::chrono::nanoseconds stepped{0};  ///< CLOCK_REALTIME less `group`
};

/// StepClock is the clock by which the players of a group compare times: CLOCK_REALTIME at the
/// start of the player, continued without its steps. chrony or PTP keep it right. The kernel slews
/// CLOCK_MONOTONIC and CLOCK_REALTIME alike, so their difference changes only when CLOCK_REALTIME
/// is stepped. A step is counted and reported to the peers, but moves no frame. Thread safety: one
/// thread.
class StepClock {
 public:
  explicit StepClock(const ClockReading& start) noexcept : ahead_(start.real - start.monotonic) {}
  StepNow now(const ClockReading& reading) noexcept {
    const std::chrono::nanoseconds stepped = reading.real - reading.monotonic - ahead_;
    if (std::chrono::abs(stepped - stepped_) >= kLeastStep) {
      stepped_ = stepped;
      ++steps_;
    }
    return {
        .monotonic = reading.monotonic, .group = reading.monotonic + ahead_, .stepped = stepped_};
  }
  /// Returns the time of this clock less CLOCK_MONOTONIC.
  [[nodiscard]] std::chrono::nanoseconds ahead_of_monotonic() const noexcept { return ahead_; }
  [[nodiscard]] uint64_t steps() const noexcept { return steps_; }

 private:
  /// Two clocks are not read at the same moment; a smaller change is no step.
  static constexpr std::chrono::nanoseconds kLeastStep = std::chrono::milliseconds(1);

  std::chrono::nanoseconds ahead_;
  std::chrono::nanoseconds stepped_{0};
  uint64_t steps_ = 0;
};

/// The accuracy of CLOCK_REALTIME as the kernel reports it, in microseconds (adjtimex(2)).
struct ClockAccuracy {
  bool known = false;         ///< the kernel answered
  bool synchronised = false;  ///< a service such as chrony disciplines the clock
  int64_t offset_us = 0;      ///< correction that is still being made
  int64_t estimated_us = 0;
  int64_t bound_us = 0;  ///< largest error
};
[[nodiscard]] inline ClockAccuracy read_clock_accuracy() noexcept {
  timex answer{};
  const int state = ::adjtimex(&answer);
  if (state < 0) return {};
  return {.known = true,
          .synchronised = state != TIME_ERROR && (answer.status & STA_UNSYNC) == 0,
          .offset_us = (answer.status & STA_NANO) != 0 ? answer.offset / 1000 : answer.offset,
          .estimated_us = answer.esterror,
          .bound_us = answer.maxerror};
}

enum class StepVerdict {
  Accepted,
  Replayed,  ///< not newer than the peer's last message: a copy, or overtaken on the way
  Untimely,  ///< older than 250 ms, or from the future: delayed, or the clocks differ
  Stranger,  ///< another sender, while this peer is alive
};

/// StepPeer decides whether the messages of one peer are fresh, and converts its times.
/// Thread safety: one thread.
class StepPeer {
 public:
  /// A peer that was not heard for this long is gone.
  static constexpr std::chrono::seconds kSilence{2};
  /// Messages are accepted at this age, by this machine's clock. The negative one allows for the
  /// difference between the clocks.
  static constexpr std::chrono::milliseconds kOldest{250};
  static constexpr std::chrono::milliseconds kNewest{-5};

  /// Two StepClocks differ by the steps that each has left out, as long as both machines' clocks
  /// are right. If one of them was just set wrong, the previous difference still holds.
  ///
  /// If this machine's clock was wrong from the start, old copies can look fresh, and fresh
  /// messages seem to come from the future. So untimely messages are remembered, too, and one from
  /// the future shows that an accepted message of its session was a copy.
  [[nodiscard]] StepVerdict judge(const StepMessage& message, const StepNow& now) noexcept {
    const bool same = heard_ && message.session == last_.session;
    if (!same && alive(now)) return StepVerdict::Stranger;
    if (is_copy(message)) return StepVerdict::Replayed;
    newest_ = {.session = message.session, .sent = message.sent, .at = now.monotonic};

    const std::chrono::nanoseconds by_real_time = now.stepped - message.stepped;
    std::chrono::nanoseconds ahead = by_real_time;
    age_ = now.group + ahead - message.sent;
    if (!timely(age_)) {
      ahead = same ? ahead_ : std::chrono::nanoseconds{0};
      const std::chrono::nanoseconds age = now.group + ahead - message.sent;
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
  [[nodiscard]] bool alive(const StepNow& now) const noexcept {
    return heard_ && now.monotonic < heard_at_ + kSilence;
  }
  /// Returns true while the peer sends messages, accepted or untimely ones.
  [[nodiscard]] bool sends(const StepNow& now) const noexcept {
    return newest_ && now.monotonic < newest_->at + kSilence;
  }
  /// Returns the last accepted message.
  [[nodiscard]] const StepMessage& last() const noexcept { return last_; }
  /// Returns the timeline of the last accepted message on this machine's StepClock; none if a later
  /// message has shown that the accepted one was a copy.
  [[nodiscard]] std::optional<StepTimeline> timeline() const noexcept {
    if (!heard_ || !last_.timeline) return std::nullopt;
    return last_.timeline->on_clock_ahead_by(-ahead_);
  }
  /// Returns the age of the last judged message by this machine's clock.
  [[nodiscard]] std::chrono::nanoseconds age() const noexcept { return age_; }

 private:
  /// The newest message of a session that was not refused as a copy.
  struct Newest {
    uint64_t session = 0;
    std::chrono::nanoseconds sent{0};  ///< time of sending, the sender's StepClock
    std::chrono::nanoseconds at{0};    ///< time of arrival, CLOCK_MONOTONIC
  };

  [[nodiscard]] bool timely(std::chrono::nanoseconds age) const noexcept {
    return age >= kNewest && age <= kOldest;
  }
  /// Returns true if a newer message is known: of the same session, or of an accepted earlier one.
  [[nodiscard]] bool is_copy(const StepMessage& message) const noexcept {
    if (newest_ && newest_->session == message.session && message.sent <= newest_->sent)
      return true;
    return heard_ && message.session != last_.session &&
           message.sent + message.stepped <= last_.sent + last_.stepped;
  }

  std::optional<Newest> newest_;
  bool heard_ = false;
  std::chrono::nanoseconds heard_at_{0};  ///< CLOCK_MONOTONIC
  std::chrono::nanoseconds ahead_{0};     ///< the peer's StepClock less this machine's
  std::chrono::nanoseconds age_{0};
  StepMessage last_;
};

/// Numbers of received messages.
struct StepMessageCounts {
  uint64_t accepted = 0;
  uint64_t refused_format = 0;    ///< not a message of this version
  uint64_t refused_key = 0;       ///< made without the key
  uint64_t refused_group = 0;     ///< the message is for another group, or for another role
  uint64_t refused_replayed = 0;  ///< StepVerdict::Replayed
  uint64_t refused_untimely = 0;
  uint64_t refused_stranger = 0;  ///< a second leader, or one follower too many, sent the message
};

struct StepIdentity {
  std::string group;
  StepKey key;
  uint64_t session = 0;  ///< random
};

/// StepMember is what both roles have in common. Thread safety: one thread.
class StepMember {
 public:
  virtual ~StepMember() = default;

  /// Handles a datagram. Returns the session of its sender if the message was accepted.
  std::optional<uint64_t> receive(std::span<const uint8_t> bytes, const StepNow& now) {
    const StepKey::Opened opened = identity_.key.open(bytes, identity_.group);
    if (!opened.message || opened.message->kind == kind_) {
      using Refusal = StepKey::Refusal;
      const Refusal refusal = opened.message ? Refusal::Group : opened.refusal;
      ++(refusal == Refusal::Format  ? counts_.refused_format
         : refusal == Refusal::Group ? counts_.refused_group
                                     : counts_.refused_key);
      return std::nullopt;
    }
    StepPeer* const peer = peer_for(*opened.message, now);
    const StepVerdict verdict =
        peer != nullptr ? peer->judge(*opened.message, now) : StepVerdict::Stranger;
    if (verdict == StepVerdict::Untimely) note_untimely(*opened.message, *peer, now);
    if (verdict == StepVerdict::Untimely || verdict == StepVerdict::Accepted) heard(*peer);
    ++(verdict == StepVerdict::Accepted   ? counts_.accepted
       : verdict == StepVerdict::Replayed ? counts_.refused_replayed
       : verdict == StepVerdict::Untimely ? counts_.refused_untimely
                                          : counts_.refused_stranger);
    if (verdict != StepVerdict::Accepted) return std::nullopt;
    return opened.message->session;
  }
  /// Returns the message for the peers; none if there is nothing to say. Call it ten times a
  /// second.
  [[nodiscard]] virtual std::optional<StepBytes> tick(const StepPlace& place,
                                                      const StepNow& now) = 0;
  /// Returns the number of peers that are alive.
  [[nodiscard]] virtual size_t peers(const StepNow& now) const = 0;
  [[nodiscard]] virtual bool alive(uint64_t session, const StepNow& now) const = 0;

  /// Returns the group's timeline on this machine's StepClock, as far as it is known.
  [[nodiscard]] const std::optional<StepTimeline>& timeline() const { return timeline_; }
  [[nodiscard]] const StepMessageCounts& counts() const { return counts_; }
  /// Returns the age of the last untimely message, by this machine's clock.
  [[nodiscard]] std::chrono::nanoseconds untimely_age() const { return untimely_age_; }

 protected:
  StepMember(StepIdentity identity, StepKind kind) : identity_(std::move(identity)), kind_(kind) {}

  /// Returns the peer that shall judge the message; null if the message is not wanted.
  [[nodiscard]] virtual StepPeer* peer_for(const StepMessage& message, const StepNow& now) = 0;
  /// Takes note of a peer that has sent a newer message, accepted or untimely.
  virtual void heard(const StepPeer& /*peer*/) {}
  /// Returns true if peers with a timeline were just heard whose clocks do not agree with this one.
  [[nodiscard]] bool clocks_disagree(const StepNow& now) const {
    return disagreed_at_ && now.monotonic < *disagreed_at_ + StepPeer::kSilence;
  }
  [[nodiscard]] StepBytes sealed(const StepPlace& place, const StepNow& now) const {
    StepMessage message{.kind = kind_,
                        .session = identity_.session,
                        .sent = now.group,
                        .stepped = now.stepped,
                        .in_step = place.in_step != 0,
                        .difference = place.difference};
    if (timeline_) message.timeline = timeline_->stated_after(now.group + kAhead);
    return identity_.key.seal(message, identity_.group);
  }

  std::optional<StepTimeline> timeline_;

 private:
  /// A timeline is stated for a frame this far ahead.
  static constexpr std::chrono::nanoseconds kAhead = std::chrono::milliseconds(500);

  /// A message that differs this much from this machine's clock is a recording.
  static constexpr std::chrono::nanoseconds kRecording = std::chrono::seconds(10);

  void note_untimely(const StepMessage& message, const StepPeer& peer, const StepNow& now) {
    untimely_age_ = peer.age();
    if (message.timeline && std::chrono::abs(peer.age()) < kRecording)
      disagreed_at_ = now.monotonic;
  }

  StepIdentity identity_;
  StepKind kind_;  ///< of the sent messages
  StepMessageCounts counts_;
  std::chrono::nanoseconds untimely_age_{0};
  std::optional<std::chrono::nanoseconds> disagreed_at_;  ///< CLOCK_MONOTONIC
};

class StepLeader final : public StepMember {
 public:
  static constexpr size_t kMaxFollowers = 32;
  /// A leader listens this long before it begins a timeline, because a group may have one.
  static constexpr std::chrono::milliseconds kListening{500};

  StepLeader(StepIdentity identity, const StepNow& now)
      : StepMember(std::move(identity), StepKind::Announcement), began_(now.monotonic) {}

  std::optional<StepBytes> tick(const StepPlace& place, const StepNow& now) override {
    std::erase_if(followers_, [&](const auto& entry) { return !entry.second.sends(now); });
    const bool listened = now.monotonic >= began_ + kListening;
    if (!timeline_ && listened && place.started != 0) timeline_ = timeline_of_group(place, now);
    if (!timeline_) return std::nullopt;
    if (timeline_->loop_frames == 0) timeline_->loop_frames = place.loop_frames;
    return sealed(place, now);
  }
  [[nodiscard]] size_t peers(const StepNow& now) const override {
    return static_cast<size_t>(std::ranges::count_if(
        followers_, [&](const auto& entry) { return entry.second.alive(now); }));
  }
  [[nodiscard]] bool alive(uint64_t session, const StepNow& now) const override {
    const auto found = followers_.find(session);
    return found != followers_.end() && found->second.alive(now);
  }
  /// Returns the largest difference between two players that are in step now, in millionths of a
  /// vblank.
  [[nodiscard]] int64_t apart(const StepPlace& own, const StepNow& now) const {
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

 private:
  /// Returns true if a player at this place can keep the timeline.
  static bool fits(const StepTimeline& timeline, const StepPlace& place) {
    const bool same_rate = std::abs(timeline.rate.hertz() / place.rate.hertz() - 1.0) < 0.01;
    const bool both_known = timeline.loop_frames > 0 && place.loop_frames > 0;
    return same_rate && (!both_known || timeline.loop_frames == place.loop_frames);
  }

  StepPeer* peer_for(const StepMessage& message, const StepNow& now) override {
    const auto found = followers_.find(message.session);
    if (found != followers_.end()) return &found->second;
    if (followers_.size() >= kMaxFollowers)
      std::erase_if(followers_, [&](const auto& entry) { return !entry.second.alive(now); });
    return followers_.size() < kMaxFollowers ? &followers_[message.session] : nullptr;
  }
  /// Returns the timeline that a follower still keeps, otherwise a new one; none while the clocks
  /// disagree.
  [[nodiscard]] std::optional<StepTimeline> timeline_of_group(const StepPlace& place,
                                                              const StepNow& now) const {
    for (const auto& [session, peer] : followers_)
      if (const auto kept = peer.timeline(); kept && fits(*kept, place)) return kept;
    if (clocks_disagree(now)) return std::nullopt;
    return StepTimeline{
        .frame = place.next_frame,
        .due = std::chrono::nanoseconds(place.next_due_ns) + (now.group - now.monotonic),
        .rate = place.rate,
        .loop_frames = place.loop_frames};
  }

  std::map<uint64_t, StepPeer> followers_;  ///< the key is the session
  std::chrono::nanoseconds began_;
};

class StepFollower final : public StepMember {
 public:
  explicit StepFollower(StepIdentity identity)
      : StepMember(std::move(identity), StepKind::Report) {}

  std::optional<StepBytes> tick(const StepPlace& place, const StepNow& now) override {
    return sealed(place, now);
  }
  [[nodiscard]] size_t peers(const StepNow& now) const override {
    return leader_.alive(now) ? 1 : 0;
  }
  [[nodiscard]] bool alive(uint64_t session, const StepNow& now) const override {
    return leader_.alive(now) && leader_.last().session == session;
  }

 private:
  StepPeer* peer_for(const StepMessage& /*message*/, const StepNow& /*now*/) override {
    return &leader_;
  }
  void heard(const StepPeer& peer) override { timeline_ = peer.timeline(); }

  StepPeer leader_;
};

}  // namespace lenticule::player
