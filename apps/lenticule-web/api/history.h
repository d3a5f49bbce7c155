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

/// Thread safety: any thread.
class TrimHistory {
 public:
  /// Reads the file; a file that is not valid counts as empty and is replaced at the next change.
  explicit TrimHistory(std::filesystem::path file);

  /// Adds an entry. Changes of the same sender within ten seconds become one entry. At most 200
  /// entries are kept, those with a name longest.
  void add(TrimEntry entry);
  /// Gives the newest entry a name.
  void name_newest(const TrimEntry& present, const std::string& name);
  /// Removes the newest entry and returns the one before; none if there are not two.
  [[nodiscard]] std::optional<TrimEntry> undo();
  [[nodiscard]] std::optional<TrimEntry> find(uint64_t number) const;
  [[nodiscard]] nlohmann::ordered_json to_json() const;

 private:
  void locked_add(TrimEntry entry);
  void save() const;

  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::vector<TrimEntry> entries_;  ///< oldest first
  uint64_t next_ = 1;
};

struct RigEntry {
  uint64_t number = 0;
  int64_t time = 0;  ///< seconds since 1970
  std::string who{};
  std::string what{};  ///< where the rig comes from
  std::string toml{};
};

/// Thread safety: any thread.
class RigHistory {
 public:
  /// Reads the file; a file that is not valid counts as empty and is replaced at the next change.
  explicit RigHistory(std::filesystem::path file);

  /// Adds an entry unless the newest one has the same rig. At most kKept entries are kept: the
  /// first one, and the newest ones.
  void add(RigEntry entry);
  [[nodiscard]] std::optional<RigEntry> find(uint64_t number) const;
  /// Returns the entries without the rigs, newest first.
  [[nodiscard]] nlohmann::ordered_json to_json() const;

  static constexpr size_t kKept = 50;

 private:
  void save() const;

  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::vector<RigEntry> entries_;  ///< oldest first
  uint64_t next_ = 1;
};

}  // namespace lenticule::web
