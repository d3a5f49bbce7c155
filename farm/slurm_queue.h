// SPDX-License-Identifier: Apache-2.0
// SlurmQueue shows which tasks of a film are in Slurm's queue, and which of them never start by
// themselves.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "farm/slurm.h"

namespace lenticule::farm {

enum class TaskState : uint8_t {
  Running,
  Waiting,
  /// Slurm holds the task after a launch that failed, for example because a controller that lost
  /// its memory launched it on a node that runs it already. `farm submit` or an administrator must
  /// release the task.
  HeldBySlurm,
  HeldByPerson,
};

/// QueuedTask is a line of squeue.
struct QueuedTask {
  uint64_t job = 0;
  std::optional<uint64_t> task{};  ///< number in the array; none for a job without an array
  TaskState state = TaskState::Waiting;
  std::string reason{};
  /// Returns the task as scontrol takes it.
  [[nodiscard]] std::string name() const;
};

/// Format of squeue whose output parse_queue() reads.
inline constexpr std::string_view kQueueFormat = "%F|%K|%t|%r|%Z";

/// Parses the output of `squeue --noheader --array` in the format kQueueFormat. Ignores jobs whose
/// working directory is not `folder`: a controller that lost its memory gives the number of a lost
/// job to another user's job. Ignores lines of another form.
[[nodiscard]] std::vector<QueuedTask> parse_queue(std::string_view output, std::string_view folder);

struct SlurmQueue {
  std::map<uint64_t, QueuedTask> chunks{};  ///< task of each chunk
  std::optional<QueuedTask> merge{};

  /// Returns tasks in a state, the merge last.
  [[nodiscard]] std::vector<QueuedTask> tasks(TaskState state) const;
};

/// Returns the tasks of a film's jobs. Of two tasks of a chunk, the one that runs or waits counts.
[[nodiscard]] SlurmQueue queue_of_film(const SlurmJobs& jobs, const std::vector<QueuedTask>& queue);

[[nodiscard]] nlohmann::json queue_json(const SlurmQueue& queue);
/// Returns lines for people; `folder` is the work folder.
[[nodiscard]] std::string queue_text(const SlurmQueue& queue, const std::string& folder);

}  // namespace lenticule::farm
