// SPDX-License-Identifier: Apache-2.0
// StepPeer decides whether the messages of one peer are fresh, and converts its times.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "player/step/step_clock.h"
#include "player/step/step_message.h"

namespace lenticule::player {

enum class StepVerdict {
  Accepted,
  Replayed,  ///< not newer than the peer's last message: a copy, or overtaken on the way
  Untimely,  ///< older than 250 ms, or from the future: delayed, or the clocks differ
  Stranger,  ///< another sender, while this peer is alive
};

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

}  // namespace lenticule::player
