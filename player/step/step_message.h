// SPDX-License-Identifier: Apache-2.0
// StepMessage is what the players of a group send to each other: a datagram of fixed size that is
// authenticated with the key of the group.
//
// Layout (little endian): magic "LNSP", version 1, kind, two bytes of flags, then the fields of the
// struct in order, the group's name in 32 bytes, and HMAC-SHA256 of all bytes before it.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "player/step/step_pacing.h"

namespace lenticule::player {

inline constexpr size_t kStepNameBytes = 32;
inline constexpr size_t kStepMessageBytes = 144;

using StepBytes = std::array<uint8_t, kStepMessageBytes>;

enum class StepKind : uint8_t {
  Announcement = 1,  ///< the leader tells all followers the timeline
  Report = 2,        ///< a follower tells the leader its place
};

struct StepMessage {
  StepKind kind = StepKind::Report;
  uint64_t session = 0;                    ///< random number of the sender's process
  std::chrono::nanoseconds sent{0};        ///< sender's StepClock; grows with every message
  std::chrono::nanoseconds stepped{0};     ///< StepNow::stepped
  std::optional<StepTimeline> timeline{};  ///< its times are those of the sender's StepClock
  bool in_step = false;
  int64_t difference = 0;  ///< displayed less due, in millionths of a vblank
  friend bool operator==(const StepMessage&, const StepMessage&) = default;
};

/// Returns the fields of an authentic message; none for values that no player sends. `bytes` has
/// kStepMessageBytes.
[[nodiscard]] std::optional<StepMessage> read_step_fields(std::span<const uint8_t> bytes);

/// StepKey authenticates the messages of one group. Thread safety: any thread.
class StepKey {
 public:
  /// Without a key the messages are protected by the socket alone.
  explicit StepKey(std::vector<uint8_t> key = {}) : key_(std::move(key)) {}
  [[nodiscard]] StepBytes seal(const StepMessage& message, std::string_view group) const;

  enum class Refusal { Format, Group, Key };
  struct Opened {
    std::optional<StepMessage> message{};  ///< empty if refused
    Refusal refusal = Refusal::Format;
  };
  [[nodiscard]] Opened open(std::span<const uint8_t> bytes, std::string_view group) const;

 private:
  std::vector<uint8_t> key_;
};

}  // namespace lenticule::player
