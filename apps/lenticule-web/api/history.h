// SPDX-License-Identifier: Apache-2.0
// TrimHistory keeps who changed the trim, when and to what, and the values that were given a name.
// RigHistory does the same for rigs.
#pragma once

#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace lenticule::web {

struct TrimEntry {
  uint64_t number = 0;
  int64_t time = 0;  ///< seconds since 1970
  std::string who{};
  std::string name{};  ///< empty unless it was saved with a name
  double offset_lenses = 0.0;
  double pitch_relative = 0.0;
};

struct RigEntry {
  uint64_t number = 0;
  int64_t time = 0;  ///< seconds since 1970
  std::string who{};
  std::string what{};  ///< origin of the rig
  std::string toml{};
};

/// History keeps entries in a file, and gives each a number. It is the base of the two below.
///
/// Thread safety: any thread.
template <class Entry>
class History {
 public:
  [[nodiscard]] std::optional<Entry> find(uint64_t number) const;
  /// Returns the entries without their rigs, newest first.
  [[nodiscard]] nlohmann::ordered_json to_json() const;

 protected:
  /// Reads the file; a file that is not valid counts as empty and is replaced at the next change.
  History(std::filesystem::path file, uint64_t most_bytes);
  void locked_append(Entry entry);
  void save() const;

  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::vector<Entry> entries_;  ///< oldest first
  uint64_t next_ = 1;
};

class TrimHistory : public History<TrimEntry> {
 public:
  explicit TrimHistory(std::filesystem::path file) : History(std::move(file), 1u << 20) {}

  /// Adds an entry. Changes of the same sender within ten seconds become one entry. At most 200
  /// entries are kept, those with a name longest.
  void add(TrimEntry entry);
  /// Gives the newest entry a name.
  void name_newest(const TrimEntry& present, const std::string& name);
  /// Removes the newest entry and returns the one before; none if there are not two.
  [[nodiscard]] std::optional<TrimEntry> undo();
};

class RigHistory : public History<RigEntry> {
 public:
  explicit RigHistory(std::filesystem::path file) : History(std::move(file), 64u << 20) {}

  /// Adds an entry unless the newest one has the same rig. At most kKept entries are kept: the
  /// first one, and the newest ones.
  void add(RigEntry entry);

  static constexpr size_t kKept = 50;
};

}  // namespace lenticule::web
