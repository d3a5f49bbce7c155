// SPDX-License-Identifier: Apache-2.0
// TrimHistory keeps who changed the trim, when and to what, and the values that were given a name.
// RigHistory does the same for rigs.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"

namespace lenticule::web {

struct TrimEntry {
  uint64_t number = 0;
  int64_t time = 0;  ///< seconds since 1970
  std::string who{};
  std::string name{};  ///< empty unless it was saved with a name
  double offset_lenses = 0.0;
  double pitch_relative = 0.0;

  NLOHMANN_DEFINE_TYPE_INTRUSIVE(TrimEntry, number, time, who, name, offset_lenses, pitch_relative)
};

struct RigEntry {
  uint64_t number = 0;
  int64_t time = 0;  ///< seconds since 1970
  std::string who{};
  std::string what{};  ///< origin of the rig
  std::string toml{};

  NLOHMANN_DEFINE_TYPE_INTRUSIVE(RigEntry, number, time, who, what, toml)
};

/// History keeps entries in a file, and gives each a number. It is the base of the two below.
///
/// Thread safety: any thread.
template <class Entry>
class History {
 public:
  [[nodiscard]] std::optional<Entry> find(uint64_t number) const {
    const std::lock_guard lock(mutex_);
    for (const Entry& entry : entries_)
      if (entry.number == number) return entry;
    return std::nullopt;
  }
  /// Returns the entries without their rigs, newest first.
  [[nodiscard]] nlohmann::ordered_json to_json() const {
    const std::lock_guard lock(mutex_);
    nlohmann::json list(std::vector<Entry>(entries_.rbegin(), entries_.rend()));
    for (nlohmann::json& entry : list) entry.erase("toml");
    return list;
  }

 protected:
  /// Reads the file; a file that is not valid counts as empty and is replaced at the next change.
  History(std::filesystem::path file, uint64_t most_bytes) : file_(std::move(file)) {
    if (!std::filesystem::exists(file_)) return;
    try {
      nlohmann::json::parse(read_text_file(file_, most_bytes)).at("entries").get_to(entries_);
    } catch (const nlohmann::json::exception&) {
      entries_.clear();
    } catch (const Error&) {
      entries_.clear();
    }
    for (const Entry& entry : entries_) next_ = std::max(next_, entry.number + 1);
  }
  void locked_append(Entry entry) {
    entry.number = next_++;
    entries_.push_back(std::move(entry));
  }
  void save() const {
    const nlohmann::json root = {{"format", 1}, {"entries", entries_}};
    write_text_file(file_, json_text(root) + "\n");
  }

  mutable std::mutex mutex_;
  std::vector<Entry> entries_;  ///< oldest first

 private:
  const std::filesystem::path file_;
  uint64_t next_ = 1;
};

class TrimHistory : public History<TrimEntry> {
 public:
  explicit TrimHistory(std::filesystem::path file) : History(std::move(file), 1u << 20) {}

  /// Adds an entry. Changes of the same sender within ten seconds become one entry. At most 200
  /// entries are kept, those with a name longest.
  void add(TrimEntry entry) {
    const std::lock_guard lock(mutex_);
    const bool continues = entries_.size() > 1 && entries_.back().who == entry.who &&
                           entries_.back().name.empty() &&
                           entry.time - entries_.back().time < kTogether_s;
    if (continues) entries_.pop_back();
    locked_append(std::move(entry));
    while (entries_.size() > kKept) {
      const auto unnamed = std::ranges::find_if(entries_, &std::string::empty, &TrimEntry::name);
      entries_.erase(unnamed == entries_.end() ? entries_.begin() : unnamed);
    }
    save();
  }
  /// Gives the newest entry a name.
  void name_newest(const TrimEntry& present, const std::string& name) {
    const std::lock_guard lock(mutex_);
    const bool is_newest = !entries_.empty() &&
                           entries_.back().offset_lenses == present.offset_lenses &&
                           entries_.back().pitch_relative == present.pitch_relative;
    if (!is_newest) locked_append(present);
    entries_.back().name = shortened(escaped(name), 60);
    save();
  }
  /// Removes the newest entry and returns the one before; none if there are not two.
  [[nodiscard]] std::optional<TrimEntry> undo() {
    const std::lock_guard lock(mutex_);
    if (entries_.size() < 2) return std::nullopt;
    entries_.pop_back();
    save();
    return entries_.back();
  }

 private:
  static constexpr size_t kKept = 200;
  static constexpr int64_t kTogether_s = 10;
};

class RigHistory : public History<RigEntry> {
 public:
  explicit RigHistory(std::filesystem::path file) : History(std::move(file), 64u << 20) {}

  /// Adds an entry unless the newest one has the same rig. At most kKept entries are kept: the
  /// first one, and the newest ones.
  void add(RigEntry entry) {
    const std::lock_guard lock(mutex_);
    if (!entries_.empty() && entries_.back().toml == entry.toml) return;
    locked_append(std::move(entry));
    while (entries_.size() > kKept) entries_.erase(entries_.begin() + 1);
    save();
  }

  static constexpr size_t kKept = 50;
};

}  // namespace lenticule::web
