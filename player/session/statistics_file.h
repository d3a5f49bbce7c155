// SPDX-License-Identifier: Apache-2.0
// StatisticsFile is the file of --stats, replaced about every second by its own thread, so that a
// full, missing or hanging disk cannot delay the playback threads.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "base/retried_writes.h"
#include "player/process/detached_worker.h"

namespace lenticule::player {

/// StatisticsFile keeps a file at the newest text that it was given. Thread safety: one thread.
class StatisticsFile {
 public:
  /// Throws Error(Failed) for a file that can never be written (require_writable_place).
  explicit StatisticsFile(const std::filesystem::path& file);
  /// Leaves the thread running if a hanging disk blocks it.
  ~StatisticsFile();
  StatisticsFile(const StatisticsFile&) = delete;
  StatisticsFile& operator=(const StatisticsFile&) = delete;

  /// Returns at once. Replaces a text that is not written yet.
  void write(std::string text);
  /// Waits at most `timeout` until the newest text was tried, without waiting for the pause after
  /// a failure. Returns an empty string if the text is in the file, else the reason.
  [[nodiscard]] std::string finish(std::chrono::milliseconds timeout);
  [[nodiscard]] WriteState state() const;
  void try_at_once();

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
  DetachedWorker worker_;
};

}  // namespace lenticule::player
