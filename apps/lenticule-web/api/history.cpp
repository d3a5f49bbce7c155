// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/history.h"

#include <algorithm>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr size_t kKept = 200;
constexpr int64_t kTogether_s = 10;
constexpr uint64_t kMaxBytes = uint64_t{1} << 20;
constexpr uint64_t kMaxRigBytes = uint64_t{64} << 20;

ordered_json entry_json(const TrimEntry& entry) {
  return {{"number", entry.number},
          {"time", entry.time},
          {"who", entry.who},
          {"name", entry.name},
          {"offset_lenses", entry.offset_lenses},
          {"pitch_relative", entry.pitch_relative}};
}

TrimEntry entry_of(const ordered_json& json) {
  return {.number = json.at("number").get<uint64_t>(),
          .time = json.at("time").get<int64_t>(),
          .who = json.at("who").get<std::string>(),
          .name = json.at("name").get<std::string>(),
          .offset_lenses = json.at("offset_lenses").get<double>(),
          .pitch_relative = json.at("pitch_relative").get<double>()};
}

}  // namespace

TrimHistory::TrimHistory(std::filesystem::path file) : file_(std::move(file)) {
  if (!std::filesystem::exists(file_)) return;
  try {
    const ordered_json root = ordered_json::parse(read_text_file(file_, kMaxBytes));
    for (const ordered_json& entry : root.at("entries")) entries_.push_back(entry_of(entry));
  } catch (const nlohmann::json::exception&) {
    entries_.clear();
  } catch (const Error&) {
    entries_.clear();
  }
  for (const TrimEntry& entry : entries_) next_ = std::max(next_, entry.number + 1);
}

void TrimHistory::save() const {
  ordered_json root = {{"format", 1}, {"entries", ordered_json::array()}};
  for (const TrimEntry& entry : entries_) root["entries"].push_back(entry_json(entry));
  write_text_file(file_, json_text(root) + "\n");
}

void TrimHistory::locked_add(TrimEntry entry) {
  const bool continues = !entries_.empty() && entries_.size() > 1 &&
                         entries_.back().who == entry.who && entries_.back().name.empty() &&
                         entry.time - entries_.back().time < kTogether_s;
  if (continues) entries_.pop_back();
  entry.number = next_++;
  entries_.push_back(std::move(entry));
  while (entries_.size() > kKept) {
    const auto unnamed = std::find_if(entries_.begin(), entries_.end(),
                                      [](const TrimEntry& one) { return one.name.empty(); });
    entries_.erase(unnamed == entries_.end() ? entries_.begin() : unnamed);
  }
}

void TrimHistory::add(TrimEntry entry) {
  const std::lock_guard lock(mutex_);
  locked_add(std::move(entry));
  save();
}

void TrimHistory::name_newest(const TrimEntry& present, const std::string& name) {
  const std::lock_guard lock(mutex_);
  const bool is_newest = !entries_.empty() &&
                         entries_.back().offset_lenses == present.offset_lenses &&
                         entries_.back().pitch_relative == present.pitch_relative;
  if (!is_newest) {
    TrimEntry entry = present;
    entry.number = next_++;
    entries_.push_back(entry);
  }
  entries_.back().name = shortened(escaped(name), 60);
  save();
}

std::optional<TrimEntry> TrimHistory::undo() {
  const std::lock_guard lock(mutex_);
  if (entries_.size() < 2) return std::nullopt;
  entries_.pop_back();
  save();
  return entries_.back();
}

std::optional<TrimEntry> TrimHistory::find(uint64_t number) const {
  const std::lock_guard lock(mutex_);
  for (const TrimEntry& entry : entries_)
    if (entry.number == number) return entry;
  return std::nullopt;
}

ordered_json TrimHistory::to_json() const {
  const std::lock_guard lock(mutex_);
  ordered_json list = ordered_json::array();
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry)
    list.push_back(entry_json(*entry));
  return list;
}

// --- rigs -----------------------------------------------------------------------------------

RigHistory::RigHistory(std::filesystem::path file) : file_(std::move(file)) {
  if (!std::filesystem::exists(file_)) return;
  try {
    const ordered_json root = ordered_json::parse(read_text_file(file_, kMaxRigBytes));
    for (const ordered_json& entry : root.at("entries"))
      entries_.push_back({.number = entry.at("number").get<uint64_t>(),
                          .time = entry.at("time").get<int64_t>(),
                          .who = entry.at("who").get<std::string>(),
                          .what = entry.at("what").get<std::string>(),
                          .toml = entry.at("toml").get<std::string>()});
  } catch (const nlohmann::json::exception&) {
    entries_.clear();
  } catch (const Error&) {
    entries_.clear();
  }
  for (const RigEntry& entry : entries_) next_ = std::max(next_, entry.number + 1);
}

void RigHistory::save() const {
  ordered_json root = {{"format", 1}, {"entries", ordered_json::array()}};
  for (const RigEntry& entry : entries_)
    root["entries"].push_back({{"number", entry.number},
                               {"time", entry.time},
                               {"who", entry.who},
                               {"what", entry.what},
                               {"toml", entry.toml}});
  write_text_file(file_, json_text(root) + "\n");
}

void RigHistory::add(RigEntry entry) {
  const std::lock_guard lock(mutex_);
  if (!entries_.empty() && entries_.back().toml == entry.toml) return;
  entry.number = next_++;
  entries_.push_back(std::move(entry));
  while (entries_.size() > kKept) entries_.erase(entries_.begin() + 1);
  save();
}

std::optional<RigEntry> RigHistory::find(uint64_t number) const {
  const std::lock_guard lock(mutex_);
  for (const RigEntry& entry : entries_)
    if (entry.number == number) return entry;
  return std::nullopt;
}

ordered_json RigHistory::to_json() const {
  const std::lock_guard lock(mutex_);
  ordered_json list = ordered_json::array();
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry)
    list.push_back({{"number", entry->number},
                    {"time", entry->time},
                    {"who", entry->who},
                    {"what", entry->what}});
  return list;
}

}  // namespace lenticule::web
