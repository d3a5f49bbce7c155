// SPDX-License-Identifier: Apache-2.0
// StepLeader and StepFollower keep the timeline of a group: pure state machines that get messages
// and clock readings, and return messages. Every player, the leader too, follows the timeline.
//
// The leader states the timeline, and begins it with the frame that it shows first. A follower
// keeps the last stated timeline when the leader is gone, so the group stays in step, and reports
// it: a leader that is started again continues the group's timeline and does not begin another.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "player/step/step_message.h"
#include "player/step/step_pacing.h"

namespace lenticule::player {

struct ClockReading {
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds real{0};
};
[[nodiscard]] ClockReading read_clocks() noexcept;

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
  explicit StepClock(const ClockReading& start) noexcept;
  StepNow now(const ClockReading& reading) noexcept;
  /// Returns the time of this clock less CLOCK_MONOTONIC.
  [[nodiscard]] std::chrono::nanoseconds ahead_of_monotonic() const noexcept { return ahead_; }
  [[nodiscard]] uint64_t steps() const noexcept { return steps_; }

 private:
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
[[nodiscard]] ClockAccuracy read_clock_accuracy() noexcept;

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

  [[nodiscard]] StepVerdict judge(const StepMessage& message, const StepNow& now) noexcept;
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
  [[nodiscard]] std::optional<StepTimeline> timeline() const noexcept;
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
  [[nodiscard]] bool is_copy(const StepMessage& message) const noexcept;

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
  std::optional<uint64_t> receive(std::span<const uint8_t> bytes, const StepNow& now);
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
  [[nodiscard]] StepBytes sealed(const StepPlace& place, const StepNow& now) const;

  std::optional<StepTimeline> timeline_;

 private:
  [[nodiscard]] bool count(StepVerdict verdict);
  void note_untimely(const StepMessage& message, const StepPeer& peer, const StepNow& now);

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

  std::optional<StepBytes> tick(const StepPlace& place, const StepNow& now) override;
  [[nodiscard]] size_t peers(const StepNow& now) const override;
  [[nodiscard]] bool alive(uint64_t session, const StepNow& now) const override;
  /// Returns the largest difference between two players that are in step now, in millionths of a
  /// vblank.
  [[nodiscard]] int64_t apart(const StepPlace& own, const StepNow& now) const;

 private:
  StepPeer* peer_for(const StepMessage& message, const StepNow& now) override;
  [[nodiscard]] std::optional<StepTimeline> timeline_of_group(const StepPlace& place,
                                                              const StepNow& now) const;

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
