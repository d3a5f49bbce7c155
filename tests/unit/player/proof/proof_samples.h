// SPDX-License-Identifier: Apache-2.0
// Makes entries of the proof of play, and sets the time zone of a test.
#pragma once

#include <cstdlib>
#include <ctime>
#include <string>
#include <utility>

#include "player/proof/proof_report.h"

namespace lenticule::test {

inline constexpr int64_t kSecond = 1'000'000;
/// 2026-10-24 12:00:00 UTC, the day before the clocks of central Europe go back.
inline constexpr int64_t kNoon = 1'792'843'200 * kSecond;

/// TimeZone sets the time zone of the process while it exists.
class TimeZone {
 public:
  explicit TimeZone(const char* name) { set(name); }
  ~TimeZone() { set("UTC"); }
  TimeZone(const TimeZone&) = delete;
  TimeZone& operator=(const TimeZone&) = delete;

 private:
  static void set(const char* name) {
    ::setenv("TZ", name, 1);
    ::tzset();
  }
};

/// Tests are independent of the time zone of the machine.
inline const TimeZone kUtc("UTC");
/// The time zone of Berlin as a rule, which needs no file of the system.
inline constexpr const char* kBerlin = "CET-1CEST,M3.5.0,M10.5.0/3";

/// Returns an entry of a play of 24 frames that was whole.
[[nodiscard]] inline player::ProofEntry whole_play(uint64_t turn, std::string item,
                                                   int64_t from_us = kNoon) {
  player::ProofEntry entry{.event = player::ProofEntry::Event::Ended,
                           .session = "0123456789abcdef0123456789abcdef",
                           .turn = turn,
                           .item = std::move(item)};
  entry.hash = "sha256:00";
  entry.panel = "LGD 0x1234";
  entry.exactness = "yes";
  entry.from_us = from_us;
  entry.until_us = from_us + kSecond;
  entry.frames = 24;
  entry.whole = 1;
  entry.process_start = 5;
  return entry;
}

/// Returns the entry that precedes `end`.
[[nodiscard]] inline player::ProofEntry start_of(player::ProofEntry end) {
  end.event = player::ProofEntry::Event::Started;
  end.until_us = end.from_us;
  end.frames = end.unseen = end.missed = end.damaged = end.whole = end.interrupted = 0;
  return end;
}

inline const player::ProofOrigin kKiosk{.unit = "lenticule-player@lobby.service",
                                        .user = "990",
                                        .program = "/usr/bin/lenticule",
                                        .boot = "b",
                                        .process = 7};

}  // namespace lenticule::test
