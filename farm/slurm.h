// SPDX-License-Identifier: Apache-2.0
// Texts for Slurm: scripts and arguments of sbatch, and what its commands print.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "farm/work_folder.h"

namespace lenticule::farm {

/// MaxArraySize of a Slurm whose configuration does not set it.
inline constexpr uint64_t kDefaultArraySize = 1001;

struct SlurmOptions {
  std::string partition{};
  std::string time{};               ///< as sbatch takes it; empty: from the timed frames
  std::string memory{};             ///< as sbatch takes it; empty: from the timed frames
  int cpus = 0;                     ///< per chunk; 0: as many as the timed frames had
  int array_limit = 0;              ///< chunks at the same time; 0: no limit
  std::vector<std::string> more{};  ///< further arguments of sbatch
};

/// SlurmJob is an array job: task i renders chunks[i].
struct SlurmJob {
  uint64_t id = 0;
  std::vector<uint64_t> chunks{};
};

/// SlurmJobs are the jobs that were submitted for a film.
struct SlurmJobs {
  std::vector<SlurmJob> arrays{};
  uint64_t merge = 0;    ///< number of the last merge job; 0: none
  std::string folder{};  ///< work folder as the last call named it: working directory of the jobs
};

/// Returns the script of an array job whose task i renders the chunk in line i of `list`, and the
/// script of the job that merges. `list` is relative to the work folder.
[[nodiscard]] std::string slurm_array_script(const WorkFolder& folder, const SlurmOptions& options,
                                             const std::string& program, const std::string& list);
[[nodiscard]] std::string slurm_merge_script(const WorkFolder& folder, const SlurmOptions& options,
                                             const std::string& program);

/// Return the arguments of sbatch that the scripts do not have.
[[nodiscard]] std::vector<std::string> slurm_array_arguments(const WorkFolder& folder,
                                                             const SlurmOptions& options,
                                                             size_t tasks);
[[nodiscard]] std::vector<std::string> slurm_merge_arguments(const WorkFolder& folder,
                                                             const SlurmOptions& options,
                                                             const std::vector<uint64_t>& after);

/// Returns the time limit of a chunk in minutes, with a margin for slower nodes.
[[nodiscard]] uint64_t slurm_minutes(const Plan& plan, int cpus);
/// Returns the memory of a chunk in MiB, with a margin.
[[nodiscard]] uint64_t slurm_mebibytes(const Plan& plan);

/// Parses what `sbatch --parsable` prints: "123" or "123;cluster".
[[nodiscard]] std::optional<uint64_t> parse_sbatch_id(std::string_view output);
/// Parses what `scontrol show config` prints; returns Slurm's default without the key.
[[nodiscard]] uint64_t parse_max_array_size(std::string_view output);

[[nodiscard]] std::string slurm_jobs_to_json(const SlurmJobs& jobs);
/// Throws Error(Input) that begins with `source`.
[[nodiscard]] SlurmJobs parse_slurm_jobs(std::string_view json, const std::string& source);

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

/// SlurmQueue shows which tasks of a film are in Slurm's queue, and which of them never start by
/// themselves.
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
