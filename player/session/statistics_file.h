// SPDX-License-Identifier: Apache-2.0
// The file of --stats: replaced about every second by a thread of its own, so that no disk, full,
// gone or hanging, is felt by those who play.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "base/retried_writes.h"

namespace lenticule::player {

/// Keeps a file at the newest text that it was given. One thread.
class StatisticsFile {
 public:
  /// Throws Error(Failed) for a file that can never be written (require_writable_place).
  explicit StatisticsFile(const std::filesystem::path& file);
  /// Leaves a thread behind that a hanging disk keeps.
  ~StatisticsFile();
  StatisticsFile(const StatisticsFile&) = delete;
  StatisticsFile& operator=(const StatisticsFile&) = delete;

  /// Returns at once. A text that was not written yet is forgotten.
  void write(std::string text);
  /// Waits until the newest text was tried, pauses between failures or not, for at most `patience`.
  /// Empty if it is in the file, else why not.
  [[nodiscard]] std::string finish(std::chrono::milliseconds patience);
  [[nodiscard]] WriteState state() const;
  void try_at_once();

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace lenticule::player
