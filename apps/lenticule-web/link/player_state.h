// SPDX-License-Identifier: Apache-2.0
// PlayerState follows a player: it subscribes to its events, and keeps its newest status, figures
// and the history of an hour. It never affects the player beyond the requests that it sends.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/link/control_link.h"
#include "base/error.h"
#include "base/text.h"
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
  void add(int64_t minute, const nlohmann::ordered_json& statistics) {
    const std::array<uint64_t, 3> now = {counter(statistics, "vblanks"),
                                         counter(statistics, "missed_vblanks"),
                                         counter(statistics, "repeated_underrun")};
    const bool is_new_player = !before_ || now[0] < (*before_)[0];
    const std::array<uint64_t, 3> before = is_new_player ? std::array<uint64_t, 3>{} : *before_;
    // Counters of the time before the first look belong to no minute of this history.
    const bool is_first = !before_;
    before_ = now;
    if (minutes_.empty() || minutes_.back().minute < minute) minutes_.push_back({.minute = minute});
    while (minutes_.size() > kMinutes || minutes_.front().minute <= minute - int64_t{kMinutes})
      minutes_.pop_front();
    if (is_first) return;
    const auto grown = [&](size_t k) { return now.at(k) - std::min(now.at(k), before.at(k)); };
    MinuteFigures& figures = minutes_.back();
    figures.vblanks += grown(0);
    figures.missed_vblanks += grown(1);
    figures.late_frames += grown(2);
  }
  [[nodiscard]] const std::deque<MinuteFigures>& minutes() const { return minutes_; }

  static constexpr size_t kMinutes = 60;

 private:
  static uint64_t counter(const nlohmann::ordered_json& statistics, const char* key) {
    const nlohmann::ordered_json& value = member(statistics, key);
    return value.is_number_unsigned() ? value.get<uint64_t>() : 0;
  }

  std::deque<MinuteFigures> minutes_;
  std::optional<std::array<uint64_t, 3>> before_;
};

/// Thread safety: any thread.
class PlayerState {
 public:
  /// Lifetime: must not outlive `link` and `clock`.
  explicit PlayerState(ControlLink& link, Clock& clock = machine_clock())
      : link_(link), clock_(clock) {
    thread_ = std::thread([this] { follow(); });
  }
  ~PlayerState() {
    stop();
    thread_.join();
  }

  /// Returns {"connected", "status", "problem", "shown_instead"}.
  [[nodiscard]] nlohmann::ordered_json state() const {
    const std::lock_guard lock(mutex_);
    return locked_state();
  }
  /// Returns the player's newest statistics; null without a player.
  [[nodiscard]] nlohmann::ordered_json statistics() const {
    const std::lock_guard lock(mutex_);
    return statistics_;
  }
  [[nodiscard]] std::vector<MinuteFigures> history() const {
    const std::lock_guard lock(mutex_);
    return {history_.minutes().begin(), history_.minutes().end()};
  }
  /// Returns the player's reports of faults since the start, newest first, at most 50.
  [[nodiscard]] nlohmann::ordered_json faults() const {
    const std::lock_guard lock(mutex_);
    return ordered_json(faults_);
  }

  /// Returns the number of the newest message.
  [[nodiscard]] uint64_t newest() const {
    const std::lock_guard lock(mutex_);
    return newest_;
  }
  /// Returns the messages after number `after`; waits at most `timeout` for one. Messages that are
  /// not kept any more are left out.
  [[nodiscard]] std::vector<Message> wait_for(uint64_t after, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    clock_.wait(changed_, lock, clock_.now() + timeout,
                [&] { return stopping_ || newest_ > after; });
    std::vector<Message> messages;
    for (const Message& message : messages_)
      if (message.number > after) messages.push_back(message);
    return messages;
  }
  /// Returns true if the first of the two events was sent after number `after` and within
  /// `timeout`, false if the second was, and none otherwise. The text of the event is put into
  /// `detail`.
  [[nodiscard]] std::optional<bool> wait_for_either(uint64_t after, const std::string& good,
                                                    const std::string& bad,
                                                    std::chrono::milliseconds timeout,
                                                    std::string& detail) {
    const auto deadline = clock_.now() + timeout;
    while (!stopped()) {
      const auto left = std::chrono::ceil<milliseconds>(deadline - clock_.now());
      if (left.count() <= 0) break;
      for (const Message& message : wait_for(after, left)) {
        after = message.number;
        if (message.name != good && message.name != bad) continue;
        detail = message.text;
        return message.name == good;
      }
    }
    return std::nullopt;
  }
  /// Reads the status now, so that the effect of a request is in the next message.
  void refresh() {
    try {
      poll_status();
    } catch (const Error& error) {
      lost(error.what());
    }
  }
  /// Adds a message of the server itself.
  void publish(const std::string& name, const nlohmann::ordered_json& content) {
    const std::lock_guard lock(mutex_);
    locked_publish(name, json_text(content));
  }
  /// Ends all waits.
  void stop() {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    wake_.signal();
    changed_.notify_all();
  }
  [[nodiscard]] bool stopped() const {
    const std::lock_guard lock(mutex_);
    return stopping_;
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  using milliseconds = std::chrono::milliseconds;
  using seconds = std::chrono::seconds;
  static constexpr size_t kKeptMessages = 256;
  static constexpr size_t kKeptFaults = 50;
  static constexpr auto kStatusEvery = seconds(1);
  static constexpr auto kStatisticsEvery = seconds(5);
  static constexpr auto kRetryAfter = seconds(1);

  static bool is_fault(const std::string& event) {
    return event == "bad_item" || event == "damaged_item" || event == "not_replaced" ||
           event == "frame_missed" || event == "too_slow";
  }

  [[nodiscard]] nlohmann::ordered_json locked_state() const {
    return {{"connected", connected_},
            {"status", status_},
            {"problem", problem_},
            {"shown_instead", shown_instead(status_)}};
  }
  void follow() noexcept {
    while (!stopped()) {
      try {
        follow_player();
      } catch (const std::exception& error) {
        lost(error.what());
      }
      std::unique_lock lock(mutex_);
      clock_.wait(changed_, lock, clock_.now() + kRetryAfter, [this] { return stopping_; });
    }
  }
  /// Listens to one player until it ends; throws then.
  void follow_player() {
    JsonLineSocket connection(link_.socket(), seconds(2), kLinkOptions);
    connection.send({{"id", 0}, {"do", "subscribe"}});
    Clock::Time status_at{};
    Clock::Time statistics_at{};
    while (!stopped()) {
      const auto now = clock_.now();
      if (now >= status_at) {
        poll_status();
        status_at = now + kStatusEvery;
      }
      if (now >= statistics_at) {
        poll_statistics();
        statistics_at = now + kStatisticsEvery;
      }
      const auto event = connection.receive(clock_.idle(milliseconds(500)), wake_.fd());
      if (event) take_event(*event);
      if (event && text_in(*event, "event") == "state") status_at = {};
    }
  }
  void take_event(const nlohmann::ordered_json& event) {
    const std::string name = text_in(event, "event");
    if (name.empty()) return;
    const std::lock_guard lock(mutex_);
    if (name != "state") locked_publish(name, json_text(event));  // the server has a "state", too
    if (!is_fault(name)) return;
    ordered_json fault = event;
    fault["time"] = clock_.date();
    faults_.push_front(std::move(fault));
    if (faults_.size() > kKeptFaults) faults_.pop_back();
  }
  void poll_status() {
    ordered_json status = link_.ask({{"do", "status"}}).body;
    const std::lock_guard lock(mutex_);
    if (connected_ && status == status_) return;
    status_ = std::move(status);
    connected_ = true;
    problem_.clear();
    locked_publish("state", json_text(locked_state()));
  }
  void poll_statistics() {
    ordered_json answer = link_.ask({{"do", "stats"}}).body;
    const std::lock_guard lock(mutex_);
    statistics_ = answer.value("statistics", ordered_json());
    if (statistics_.is_object()) history_.add(clock_.date() / 60, statistics_);
  }
  void locked_publish(const std::string& name, std::string text) {
    messages_.push_back({.number = ++newest_, .name = name, .text = std::move(text)});
    if (messages_.size() > kKeptMessages) messages_.pop_front();
    changed_.notify_all();
  }
  void lost(const std::string& problem) {
    const std::lock_guard lock(mutex_);
    problem_ = problem;
    if (!connected_ && !messages_.empty()) return;
    connected_ = false;
    status_ = nullptr;
    statistics_ = nullptr;
    locked_publish("state", json_text(locked_state()));
  }

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
