// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/link/player_state.h"

#include <algorithm>

#include "base/error.h"
#include "base/print.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr size_t kKeptMessages = 256;
constexpr size_t kKeptFaults = 50;
constexpr auto kStatusEvery = seconds(1);
constexpr auto kStatisticsEvery = seconds(5);
constexpr auto kRetryAfter = seconds(1);

uint64_t counter(const ordered_json& statistics, const char* key) {
  const auto found = statistics.find(key);
  return found != statistics.end() && found->is_number_unsigned() ? found->get<uint64_t>() : 0;
}

bool is_fault(const std::string& event) {
  return event == "bad_item" || event == "damaged_item" || event == "not_replaced" ||
         event == "frame_missed" || event == "too_slow";
}

}  // namespace

void HourHistory::add(int64_t minute, const ordered_json& statistics) {
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

PlayerState::PlayerState(ControlLink& link, Clock& clock) : link_(link), clock_(clock) {
  thread_ = std::thread([this] { follow(); });
}

PlayerState::~PlayerState() {
  stop();
  thread_.join();
}

void PlayerState::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.signal();
  changed_.notify_all();
}

bool PlayerState::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

ordered_json PlayerState::state() const {
  const std::lock_guard lock(mutex_);
  return {{"connected", connected_}, {"status", status_}, {"problem", problem_}};
}

ordered_json PlayerState::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

std::vector<MinuteFigures> PlayerState::history() const {
  const std::lock_guard lock(mutex_);
  return {history_.minutes().begin(), history_.minutes().end()};
}

ordered_json PlayerState::faults() const {
  const std::lock_guard lock(mutex_);
  ordered_json list = ordered_json::array();
  for (const ordered_json& fault : faults_) list.push_back(fault);
  return list;
}

uint64_t PlayerState::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

std::vector<Message> PlayerState::wait_for(uint64_t after, milliseconds timeout) {
  std::unique_lock lock(mutex_);
  clock_.wait(changed_, lock, clock_.now() + timeout, [&] { return stopping_ || newest_ > after; });
  std::vector<Message> messages;
  for (const Message& message : messages_)
    if (message.number > after) messages.push_back(message);
  return messages;
}

std::optional<bool> PlayerState::wait_for_either(uint64_t after, const std::string& good,
                                                 const std::string& bad, milliseconds timeout,
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

void PlayerState::refresh() {
  try {
    poll_status();
  } catch (const Error& error) {
    lost(error.what());
  }
}

void PlayerState::publish(const std::string& name, const ordered_json& content) {
  {
    const std::lock_guard lock(mutex_);
    locked_publish(name, json_text(content));
  }
  changed_.notify_all();
}

void PlayerState::locked_publish(const std::string& name, std::string text) {
  messages_.push_back({.number = ++newest_, .name = name, .text = std::move(text)});
  if (messages_.size() > kKeptMessages) messages_.pop_front();
}

void PlayerState::lost(const std::string& problem) {
  {
    const std::lock_guard lock(mutex_);
    problem_ = problem;
    if (!connected_ && !messages_.empty()) return;
    connected_ = false;
    status_ = nullptr;
    statistics_ = nullptr;
    locked_publish("state", json_text(ordered_json{
                                {"connected", false}, {"status", nullptr}, {"problem", problem_}}));
  }
  changed_.notify_all();
}

void PlayerState::poll_status() {
  ordered_json status = link_.ask({{"do", "status"}}).body;
  {
    const std::lock_guard lock(mutex_);
    if (connected_ && status == status_) return;
    status_ = std::move(status);
    connected_ = true;
    problem_.clear();
    locked_publish("state", json_text(ordered_json{
                                {"connected", true}, {"status", status_}, {"problem", ""}}));
  }
  changed_.notify_all();
}

void PlayerState::poll_statistics() {
  ordered_json answer = link_.ask({{"do", "stats"}}).body;
  const std::lock_guard lock(mutex_);
  statistics_ = answer.value("statistics", ordered_json());
  if (statistics_.is_object()) history_.add(clock_.date() / 60, statistics_);
}

void PlayerState::take_event(const ordered_json& event) {
  const auto name = event.find("event");
  if (name == event.end() || !name->is_string()) return;
  {
    const std::lock_guard lock(mutex_);
    locked_publish(name->get<std::string>(), json_text(event));
    if (is_fault(name->get_ref<const std::string&>())) {
      ordered_json fault = event;
      fault["time"] = clock_.date();
      faults_.push_front(std::move(fault));
      if (faults_.size() > kKeptFaults) faults_.pop_back();
    }
  }
  changed_.notify_all();
}

/// Listens to one player until it ends; throws then.
void PlayerState::follow_player() {
  LinkConnection connection(link_.socket(), seconds(2));
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
  }
}

void PlayerState::follow() noexcept {
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

}  // namespace lenticule::web
