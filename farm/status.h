// SPDX-License-Identifier: Apache-2.0
// read_status finds out how far a farm is, from the files of the work folder alone, so that it
// works with every engine. Clocks of nodes are never compared: times are those that the file system
// gives to files.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "farm/work_folder.h"

namespace lenticule::farm {

struct RunningChunk {
  ChunkProgress progress;
  double silent_seconds = 0.0;  ///< since the process last reported
};

struct NodeStatus {
  std::string node;
  uint64_t chunks = 0;
  uint64_t frames = 0;
  uint64_t running = 0;
  double frame_seconds = 0.0;  ///< mean time of a frame
};

struct SlowChunk {
  uint64_t chunk = 0;
  std::string node;
  double seconds = 0.0;
};

struct FarmStatus {
  uint64_t chunks = 0, frames = 0;
  uint64_t chunks_done = 0, frames_done = 0;
  uint64_t bytes_done = 0;
  std::vector<RunningChunk> running{};  ///< of chunks that are not done
  std::vector<ChunkFailure> failed{};   ///< not done and not running
  std::vector<uint64_t> missing{};      ///< not done, not running and not failed
  std::vector<uint64_t> differing{};    ///< rendered with other bytes by two processes
  std::vector<SlowChunk> slowest{};     ///< the slowest first
  std::vector<NodeStatus> nodes{};      ///< by name
  double frames_per_second = 0.0;       ///< of the last ten minutes; 0: unknown
  std::optional<double> seconds_left{};
  bool merged = false;  ///< the film exists

  [[nodiscard]] bool complete() const { return chunks_done == chunks; }
};

/// A process that has not reported for this time is not counted as running: it was killed, or its
/// node is gone.
inline constexpr double kSilentSeconds = 300.0;

/// Returns the time by the clock of the folder's file system, in seconds.
[[nodiscard]] double folder_time(const std::filesystem::path& folder);

[[nodiscard]] FarmStatus read_status(const WorkFolder& folder, double now);

[[nodiscard]] nlohmann::json status_json(const FarmStatus& status);
/// Returns lines for people.
[[nodiscard]] std::string status_text(const FarmStatus& status);

}  // namespace lenticule::farm
