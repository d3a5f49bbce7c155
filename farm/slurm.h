// SPDX-License-Identifier: Apache-2.0
// Texts for Slurm: scripts and arguments of sbatch, and what its commands print.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/numbers.h"
#include "base/text.h"
#include "farm/plan.h"
#include "farm/work_folder.h"
#include "optics/json_fields.h"

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

inline int cpus_of(const Plan& plan, const SlurmOptions& options) {
  return options.cpus > 0 ? options.cpus : std::max(1, plan.timing.threads);
}

/// Returns a name of letters and digits.
inline std::string job_name(const Plan& plan, const char* what) {
  std::string name = std::filesystem::path(plan.output).stem().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '-';
  return fmt::format("{}-{}", name, what);
}

inline std::string script_head(const std::string& name, const SlurmOptions& options) {
  return fmt::format(
      "#!/bin/sh\n#SBATCH --job-name={}\n{}#SBATCH --nodes=1\n#SBATCH --ntasks=1\n"
      "#SBATCH --requeue\n#SBATCH --open-mode=append\n",
      name,
      options.partition.empty() ? "" : fmt::format("#SBATCH --partition={}\n", options.partition));
}

inline constexpr double kMemoryMargin = 1.5;
inline constexpr uint64_t kMemoryStep = 256;      ///< MiB
inline constexpr uint64_t kDefaultMemory = 4096;  ///< MiB, without timed frames

inline constexpr double kTimeMargin = 3.0;  ///< factor for nodes slower than the one that planned
inline constexpr double kStartMinutes = 5.0;
inline constexpr uint64_t kDefaultMinutes = 24 * 60;

/// Returns the time limit of a chunk in minutes, with a margin for slower nodes.
[[nodiscard]] inline uint64_t slurm_minutes(const Plan& plan, int cpus) {
  if (plan.timing.frames == 0) return kDefaultMinutes;
  const double fewer =
      std::max(1.0, static_cast<double>(std::max(1, plan.timing.threads)) / std::max(1, cpus));
  // One frame more than the chunk has: the frame that chooses predictors.
  const double frames = static_cast<double>(std::min(plan.chunk_frames, plan.end - plan.begin) + 1);
  const double seconds = plan.timing.start_seconds + frames * plan.timing.slowest_seconds * fewer;
  return static_cast<uint64_t>(std::ceil(seconds * kTimeMargin / 60.0 + kStartMinutes));
}
/// Returns the memory of a chunk in MiB, with a margin.
[[nodiscard]] inline uint64_t slurm_mebibytes(const Plan& plan) {
  if (plan.timing.peak_bytes == 0) return kDefaultMemory;
  const double wanted = kMemoryMargin * static_cast<double>(plan.timing.peak_bytes) / (1 << 20);
  return (static_cast<uint64_t>(wanted) / kMemoryStep + 1) * kMemoryStep;
}

/// Returns the script of an array job whose task i renders the chunk in line i of `list`, and the
/// script of the job that merges. `list` is relative to the work folder.
[[nodiscard]] inline std::string slurm_array_script(const WorkFolder& folder,
                                                    const SlurmOptions& options,
                                                    const std::string& program,
                                                    const std::string& list) {
  const Plan& plan = folder.plan();
  const int cpus = cpus_of(plan, options);
  return fmt::format(
      "{}#SBATCH --cpus-per-task={}\n#SBATCH --mem={}\n#SBATCH --time={}\n"
      "#SBATCH --output=slurm/logs/%A_%a.log\n"
      "chunk=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {})\n"
      "exec {} farm render {} \"$chunk\" --threads \"${{SLURM_CPUS_PER_TASK:-{}}}\"\n",
      script_head(job_name(plan, "chunks"), options), cpus,
      options.memory.empty() ? fmt::format("{}M", slurm_mebibytes(plan)) : options.memory,
      options.time.empty() ? fmt::format("{}", slurm_minutes(plan, cpus)) : options.time,
      shell_quoted(list), shell_quoted(program), shell_quoted(folder.path().string()), cpus);
}
/// Time within which a file of another node shows in the folder of a network file system.
inline constexpr int kMergeWaitSeconds = 120;

[[nodiscard]] inline std::string slurm_merge_script(const WorkFolder& folder,
                                                    const SlurmOptions& options,
                                                    const std::string& program) {
  return fmt::format(
      "{}#SBATCH --cpus-per-task=1\n#SBATCH --mem=512M\n"
      "#SBATCH --output=slurm/logs/merge-%j.log\nexec {} farm merge {} --wait {}\n",
      script_head(job_name(folder.plan(), "merge"), options), shell_quoted(program),
      shell_quoted(folder.path().string()), kMergeWaitSeconds);
}

inline std::vector<std::string> common_arguments(const WorkFolder& folder,
                                                 const SlurmOptions& options) {
  std::vector<std::string> arguments = {"--parsable", "--chdir=" + folder.path().string()};
  arguments.insert(arguments.end(), options.more.begin(), options.more.end());
  return arguments;
}

/// Return the arguments of sbatch that the scripts do not have.
[[nodiscard]] inline std::vector<std::string> slurm_array_arguments(const WorkFolder& folder,
                                                                    const SlurmOptions& options,
                                                                    size_t tasks) {
  std::vector<std::string> arguments = common_arguments(folder, options);
  const std::string limit = options.array_limit > 0 ? fmt::format("%{}", options.array_limit) : "";
  arguments.push_back(fmt::format("--array=0-{}{}", tasks - 1, limit));
  return arguments;
}
[[nodiscard]] inline std::vector<std::string> slurm_merge_arguments(
    const WorkFolder& folder, const SlurmOptions& options, const std::vector<uint64_t>& after) {
  std::vector<std::string> arguments = common_arguments(folder, options);
  // afterany, not afterok: after a failure, the merge names the chunks that are missing.
  if (!after.empty())
    arguments.push_back(fmt::format("--dependency=afterany:{}", fmt::join(after, ":")));
  return arguments;
}

inline std::string_view trimmed(std::string_view text) {
  const size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// Parses what `sbatch --parsable` prints: "123" or "123;cluster".
[[nodiscard]] inline std::optional<uint64_t> parse_sbatch_id(std::string_view output) {
  std::string_view line = trimmed(take_until(output, '\n'));
  return number_from<uint64_t>(take_until(line, ';'));
}
/// Parses what `scontrol show config` prints; returns Slurm's default without the key.
[[nodiscard]] inline uint64_t parse_max_array_size(std::string_view output) {
  while (!output.empty()) {
    std::string_view line = take_until(output, '\n');
    if (trimmed(take_until(line, '=')) != "MaxArraySize") continue;
    const auto size = number_from<uint64_t>(trimmed(line));
    if (size && *size > 0) return *size;
  }
  return kDefaultArraySize;
}

[[nodiscard]] inline std::string slurm_jobs_to_json(const SlurmJobs& jobs) {
  nlohmann::json list = nlohmann::json::array();
  for (const SlurmJob& job : jobs.arrays) list.push_back({{"id", job.id}, {"chunks", job.chunks}});
  return json_text(nlohmann::json{{"jobs", list}, {"merge", jobs.merge}, {"folder", jobs.folder}}) +
         "\n";
}
/// Throws Error(Input) that begins with `source`.
[[nodiscard]] inline SlurmJobs parse_slurm_jobs(std::string_view text, const std::string& source) {
  const nlohmann::json object = optics::parse_json(text, source);
  const optics::JsonFields fields(object, source);
  const nlohmann::json& list = fields.need("jobs");
  if (!list.is_array()) fields.fail("jobs", "not a list");
  SlurmJobs jobs{.merge = fields.whole("merge", UINT64_MAX), .folder = fields.text("folder")};
  for (const nlohmann::json& one : list) {
    const optics::JsonFields job(one, source);
    jobs.arrays.push_back(
        {.id = job.whole("id", UINT64_MAX), .chunks = job.wholes("chunks", UINT64_MAX)});
  }
  return jobs;
}

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
  [[nodiscard]] std::string name() const {
    return task ? fmt::format("{}_{}", job, *task) : fmt::format("{}", job);
  }
};

/// Format of squeue whose output parse_queue() reads.
inline constexpr std::string_view kQueueFormat = "%F|%K|%t|%r|%Z";

inline constexpr size_t kFields = 5;

/// Returns a reason without the differences between versions of Slurm.
inline std::string plain(std::string_view reason) {
  std::string text = lower_case(std::string(reason));
  std::ranges::replace(text, '_', ' ');
  return text;
}

inline TaskState state_of(std::string_view state, std::string_view reason) {
  if (state == "R" || state == "CG" || state == "CF") return TaskState::Running;
  const std::string text = plain(reason);
  if (text == "launch failed requeued held" || text == "jobholdmaxrequeue")
    return TaskState::HeldBySlurm;
  const bool held = text.find("held") != std::string::npos;
  return held ? TaskState::HeldByPerson : TaskState::Waiting;
}

inline std::optional<QueuedTask> parse_line(std::string_view line, std::string_view folder) {
  std::array<std::string_view, kFields> fields;
  // The folder is last, since it may contain the separator.
  for (size_t i = 0; i + 1 < kFields; ++i) fields[i] = take_until(line, '|');
  fields.back() = line;
  const auto job = number_from<uint64_t>(fields[0]);
  if (!job || fields.back() != folder) return std::nullopt;
  return QueuedTask{.job = *job,
                    .task = number_from<uint64_t>(fields[1]),
                    .state = state_of(fields[2], fields[3]),
                    .reason = std::string(fields[3])};
}

/// Parses the output of `squeue --noheader --array` in the format kQueueFormat. Ignores jobs whose
/// working directory is not `folder`: a controller that lost its memory gives the number of a lost
/// job to another user's job. Ignores lines of another form.
[[nodiscard]] inline std::vector<QueuedTask> parse_queue(std::string_view output,
                                                         std::string_view folder) {
  std::vector<QueuedTask> tasks;
  while (!output.empty()) {
    const auto task = parse_line(take_until(output, '\n'), folder);
    if (task) tasks.push_back(*task);
  }
  return tasks;
}

/// SlurmQueue shows which tasks of a film are in Slurm's queue, and which of them never start by
/// themselves.
struct SlurmQueue {
  std::map<uint64_t, QueuedTask> chunks{};  ///< task of each chunk
  std::optional<QueuedTask> merge{};

  /// Returns tasks in a state, the merge last.
  [[nodiscard]] std::vector<QueuedTask> tasks(TaskState state) const {
    std::vector<QueuedTask> found;
    for (const auto& [chunk, task] : chunks)
      if (task.state == state) found.push_back(task);
    if (merge && merge->state == state) found.push_back(*merge);
    return found;
  }
};

inline bool starts_by_itself(TaskState state) {
  return state == TaskState::Running || state == TaskState::Waiting;
}

/// Returns the tasks of a film's jobs. Of two tasks of a chunk, the one that runs or waits counts.
[[nodiscard]] inline SlurmQueue queue_of_film(const SlurmJobs& jobs,
                                              const std::vector<QueuedTask>& queue) {
  std::map<uint64_t, const SlurmJob*> arrays;
  for (const SlurmJob& job : jobs.arrays) arrays[job.id] = &job;
  SlurmQueue film;
  for (const QueuedTask& task : queue) {
    if (!task.task && task.job == jobs.merge) film.merge = task;
    const auto array = arrays.find(task.job);
    if (!task.task || array == arrays.end() || *task.task >= array->second->chunks.size()) continue;
    const auto [known, is_new] = film.chunks.insert({array->second->chunks[*task.task], task});
    if (!is_new && starts_by_itself(task.state)) known->second = task;
  }
  return film;
}

inline constexpr size_t kChunksShown = 60;  ///< characters

inline std::string chunks_text(const SlurmQueue& queue, TaskState state) {
  std::vector<uint64_t> chunks;
  for (const auto& [chunk, task] : queue.chunks)
    if (task.state == state) chunks.push_back(chunk);
  std::string text = chunks.empty() ? "" : "chunks " + shortened(ranges_text(chunks), kChunksShown);
  if (queue.merge && queue.merge->state == state) text += text.empty() ? "merge" : " and merge";
  return text;
}

inline std::string reasons_text(const std::vector<QueuedTask>& tasks) {
  std::set<std::string> reasons;
  for (const QueuedTask& task : tasks) reasons.insert(escaped(task.reason));
  return fmt::format("{}", fmt::join(reasons, ", "));
}

inline std::string held_text(const SlurmQueue& queue, TaskState state, const char* holder) {
  const std::vector<QueuedTask> held = queue.tasks(state);
  return held.empty() ? ""
                      : fmt::format("held by {}: {} ({})\n", holder, chunks_text(queue, state),
                                    reasons_text(held));
}

inline nlohmann::json held_json(const SlurmQueue& queue) {
  nlohmann::json list = nlohmann::json::array();
  const auto add = [&](const QueuedTask& task, const nlohmann::json& chunk) {
    if (starts_by_itself(task.state)) return;
    list.push_back({{"task", task.name()},
                    {"chunk", chunk},
                    {"reason", task.reason},
                    {"by_slurm", task.state == TaskState::HeldBySlurm}});
  };
  for (const auto& [chunk, task] : queue.chunks) add(task, chunk);
  if (queue.merge) add(*queue.merge, nullptr);
  return list;
}

[[nodiscard]] inline nlohmann::json queue_json(const SlurmQueue& queue) {
  return {{"running", queue.tasks(TaskState::Running).size()},
          {"waiting", queue.tasks(TaskState::Waiting).size()},
          {"held", held_json(queue)}};
}
/// Returns lines for people; `folder` is the work folder.
[[nodiscard]] inline std::string queue_text(const SlurmQueue& queue, const std::string& folder) {
  const std::vector<QueuedTask> waiting = queue.tasks(TaskState::Waiting);
  std::string text =
      fmt::format("Slurm: {} running, {} waiting{}\n", queue.tasks(TaskState::Running).size(),
                  waiting.size(), waiting.empty() ? "" : " (" + reasons_text(waiting) + ")");
  const std::string by_slurm = held_text(queue, TaskState::HeldBySlurm, "Slurm");
  text += by_slurm;
  if (!by_slurm.empty())
    text += fmt::format("lenticule farm submit {} --slurm releases them\n", shell_quoted(folder));
  return text + held_text(queue, TaskState::HeldByPerson, "a person, until scontrol release");
}

}  // namespace lenticule::farm
