// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/history.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr size_t kKeptTrims = 200;
constexpr int64_t kTogether_s = 10;

/// Calls `field` with the name and the value of each field that goes into the file.
template <class Field>
void for_fields(TrimEntry& entry, const Field& field) {
  field("number", entry.number);
  field("time", entry.time);
  field("who", entry.who);
  field("name", entry.name);
  field("offset_lenses", entry.offset_lenses);
  field("pitch_relative", entry.pitch_relative);
}
template <class Field>
void for_fields(RigEntry& entry, const Field& field) {
  field("number", entry.number);
  field("time", entry.time);
  field("who", entry.who);
  field("what", entry.what);
  field("toml", entry.toml);
}

template <class Entry>
ordered_json json_of(Entry entry) {
  ordered_json json;
  for_fields(entry, [&](const char* key, const auto& value) { json[key] = value; });
  return json;
}

}  // namespace

template <class Entry>
History<Entry>::History(std::filesystem::path file, uint64_t most_bytes) : file_(std::move(file)) {
  if (!std::filesystem::exists(file_)) return;
  try {
    const ordered_json root = ordered_json::parse(read_text_file(file_, most_bytes));
    for (const ordered_json& json : root.at("entries"))
      for_fields(entries_.emplace_back(),
                 [&](const char* key, auto& value) { json.at(key).get_to(value); });
  } catch (const nlohmann::json::exception&) {
    entries_.clear();
  } catch (const Error&) {
    entries_.clear();
  }
  for (const Entry& entry : entries_) next_ = std::max(next_, entry.number + 1);
}

template <class Entry>
void History<Entry>::locked_append(Entry entry) {
  entry.number = next_++;
  entries_.push_back(std::move(entry));
}

template <class Entry>
void History<Entry>::save() const {
  ordered_json root = {{"format", 1}, {"entries", ordered_json::array()}};
  for (const Entry& entry : entries_) root["entries"].push_back(json_of(entry));
  write_text_file(file_, json_text(root) + "\n");
}

template <class Entry>
std::optional<Entry> History<Entry>::find(uint64_t number) const {
  const std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_)
    if (entry.number == number) return entry;
  return std::nullopt;
}

template <class Entry>
ordered_json History<Entry>::to_json() const {
  const std::lock_guard lock(mutex_);
  ordered_json list = ordered_json::array();
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
    list.push_back(json_of(*entry));
    list.back().erase("toml");
  }
  return list;
}

template class History<TrimEntry>;
template class History<RigEntry>;

void TrimHistory::add(TrimEntry entry) {
  const std::lock_guard lock(mutex_);
  const bool continues = entries_.size() > 1 && entries_.back().who == entry.who &&
                         entries_.back().name.empty() &&
                         entry.time - entries_.back().time < kTogether_s;
  if (continues) entries_.pop_back();
  locked_append(std::move(entry));
  while (entries_.size() > kKeptTrims) {
    const auto unnamed = std::ranges::find_if(entries_, &std::string::empty, &TrimEntry::name);
    entries_.erase(unnamed == entries_.end() ? entries_.begin() : unnamed);
  }
  save();
}

void TrimHistory::name_newest(const TrimEntry& present, const std::string& name) {
  const std::lock_guard lock(mutex_);
  const bool is_newest = !entries_.empty() &&
                         entries_.back().offset_lenses == present.offset_lenses &&
                         entries_.back().pitch_relative == present.pitch_relative;
  if (!is_newest) locked_append(present);
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

void RigHistory::add(RigEntry entry) {
  const std::lock_guard lock(mutex_);
  if (!entries_.empty() && entries_.back().toml == entry.toml) return;
  locked_append(std::move(entry));
  while (entries_.size() > kKept) entries_.erase(entries_.begin() + 1);
  save();
}

}  // namespace lenticule::web
