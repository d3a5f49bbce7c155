// SPDX-License-Identifier: Apache-2.0
// PlayerState follows a player: it subscribes to its events, and keeps its newest status, figures
// and the history of an hour. It never affects the player beyond the requests that it sends.
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/link/control_link.h"
#include "base/unique_fd.h"

namespace lenticule::web {

/// Message is an event for the pages, with its number.
struct Message {
  uint64_t number = 0;
  std::string name;  ///< "state", or the player's own name of its event
  std::string text;  ///< one line of JSON
};

/// Figures of one minute.
struct MinuteFigures {
  int64_t minute = 0;  ///< minutes since 1970
  uint64_t vblanks = 0;
  uint64_t missed_vblanks = 0;
  uint64_t late_frames = 0;
};

/// Adds up the counters of a player in minutes. A counter that became smaller belongs to a new
/// player.
class HourHistory {
 public:
  void add(int64_t minute, const nlohmann::ordered_json& statistics);
  [[nodiscard]] const std::deque<MinuteFigures>& minutes() const { return minutes_; }

  static constexpr size_t kMinutes = 60;

 private:
  std::deque<MinuteFigures> minutes_;
  std::optional<std::array<uint64_t, 3>> before_;
};

/// Thread safety: any thread.
class PlayerState {
 public:
  /// Lifetime: must not outlive `link` and `clock`.
  explicit PlayerState(ControlLink& link, Clock& clock = machine_clock());
  ~PlayerState();
  PlayerState(const PlayerState&) = delete;
  PlayerState& operator=(const PlayerState&) = delete;

  /// Returns {"connected", "status", "problem"}.
  [[nodiscard]] nlohmann::ordered_json state() const;
  /// Returns the player's newest statistics; null without a player.
  [[nodiscard]] nlohmann::ordered_json statistics() const;
  [[nodiscard]] std::vector<MinuteFigures> history() const;
  /// Returns the player's reports of faults since the start, newest first, at most 50.
  [[nodiscard]] nlohmann::ordered_json faults() const;

  /// Returns the number of the newest message.
  [[nodiscard]] uint64_t newest() const;
  /// Returns the messages after number `after`; waits at most `timeout` for one. Messages that are
  /// not kept any more are left out.
  [[nodiscard]] std::vector<Message> wait_for(uint64_t after, std::chrono::milliseconds timeout);
  /// Returns true if the first of the two events was sent after number `after` and within
  /// `timeout`, false if the second was, and none otherwise. The text of the event is put into
  /// `detail`.
  [[nodiscard]] std::optional<bool> wait_for_either(uint64_t after, const std::string& good,
                                                    const std::string& bad,
                                                    std::chrono::milliseconds timeout,
                                                    std::string& detail);
  /// Reads the status now, so that the effect of a request is in the next message.
  void refresh();
  /// Adds a message of the server itself.
  void publish(const std::string& name, const nlohmann::ordered_json& content);
  /// Ends all waits.
  void stop();
  [[nodiscard]] bool stopped() const;

 private:
  void follow() noexcept;
  void follow_player();
  void take_event(const nlohmann::ordered_json& event);
  void poll_status();
  void poll_statistics();
  void locked_publish(const std::string& name, std::string text);
  void lost(const std::string& problem);

  ControlLink& link_;
  Clock& clock_;
  WakeFd wake_{"web"};
  mutable std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  nlohmann::ordered_json status_;
  nlohmann::ordered_json statistics_;
  std::string problem_ = "not asked yet";
  bool connected_ = false;
  HourHistory history_;
  std::deque<Message> messages_;
  std::deque<nlohmann::ordered_json> faults_;
  uint64_t newest_ = 0;
  bool stopping_ = false;
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::web
