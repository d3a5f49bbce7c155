// SPDX-License-Identifier: Apache-2.0
// PlayOutputs looks after the files that a run of `lenticule play` writes: statistics, recording,
// trim. A file that cannot be written is reported and tried again; playing goes on.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/retried_writes.h"
#include "player/session/play_plan.h"

namespace lenticule::player {

/// StatisticsFile is the file of --stats, replaced about every second by its own thread, so that a
/// full, missing or hanging disk cannot delay the playback threads. Thread safety: one thread.
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
};

/// Thread safety: one thread.
class PlayOutputs {
 public:
  /// Opens the file of --stats. Lifetime: must not outlive `flags` and `plan`.
  PlayOutputs(const PlayFlags& flags, PlayPlan& plan);

  /// Opens the recording of --record, if there is one.
  void open_recording();
  void write_statistics(const nlohmann::ordered_json& statistics);
  /// Adds the key `write_trouble`.
  void describe_problems(nlohmann::ordered_json& statistics) const;
  /// Reports each file once when writing begins to fail, and once when it works again. Returns all
  /// present reasons in one line; empty if all files can be written.
  [[nodiscard]] std::string report_problems();
  /// Writes without waiting for the pause after a failure.
  void try_at_once();
  /// Saves the trim again if that failed.
  void save_trim_again();

  /// Completes the recording, after its display was closed. Returns its statistics; null
  /// without a recording.
  [[nodiscard]] nlohmann::ordered_json finish_recording();
  /// Waits until the last statistics are written, at most ten seconds.
  void finish_statistics();
  /// Returns the first output that is incomplete at the end.
  [[nodiscard]] const std::optional<Error>& incomplete() const { return incomplete_; }

 private:
  struct File {
    std::string name;
    WriteState state;
  };
  [[nodiscard]] std::vector<File> files() const;

  const PlayFlags& flags_;
  PlayPlan& plan_;
  std::optional<StatisticsFile> statistics_;
  std::set<std::string> cannot_write_;  ///< files already reported as not writable
  std::optional<Error> incomplete_;
};

}  // namespace lenticule::player
