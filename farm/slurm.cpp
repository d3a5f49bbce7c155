// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <set>

#include "base/numbers.h"
#include "base/text.h"
#include "farm/plan.h"
#include "optics/json_fields.h"

namespace lenticule::farm {
namespace {

using nlohmann::json;

constexpr double kTimeMargin = 3.0;  ///< factor for nodes slower than the one that planned
constexpr double kStartMinutes = 5.0;
constexpr double kMemoryMargin = 1.5;
constexpr uint64_t kMemoryStep = 256;      ///< MiB
constexpr uint64_t kDefaultMemory = 4096;  ///< MiB, without timed frames
constexpr uint64_t kDefaultMinutes = 24 * 60;
/// Time within which a file of another node shows in the folder of a network file system.
constexpr int kMergeWaitSeconds = 120;

int cpus_of(const Plan& plan, const SlurmOptions& options) {
  return options.cpus > 0 ? options.cpus : std::max(1, plan.timing.threads);
}

/// Returns a name of letters and digits.
std::string job_name(const Plan& plan, const char* what) {
  std::string name = std::filesystem::path(plan.output).stem().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '-';
  return fmt::format("{}-{}", name, what);
}

std::string script_head(const std::string& name, const SlurmOptions& options) {
  std::string text = "#!/bin/sh\n";
  text += fmt::format("#SBATCH --job-name={}\n", name);
  if (!options.partition.empty())
    text += fmt::format("#SBATCH --partition={}\n", options.partition);
  text += "#SBATCH --nodes=1\n#SBATCH --ntasks=1\n#SBATCH --requeue\n#SBATCH --open-mode=append\n";
  return text;
}

std::vector<std::string> common_arguments(const WorkFolder& folder, const SlurmOptions& options) {
  std::vector<std::string> arguments = {"--parsable", "--chdir=" + folder.path().string()};
  arguments.insert(arguments.end(), options.more.begin(), options.more.end());
  return arguments;
}

/// Returns the text before the first line end, and removes it.
std::string_view next_line(std::string_view& text) {
  return take_until(text, '\n');
}

std::string_view trimmed(std::string_view text) {
  const size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

}  // namespace

uint64_t slurm_minutes(const Plan& plan, int cpus) {
  if (plan.timing.frames == 0) return kDefaultMinutes;
  const double fewer =
      std::max(1.0, static_cast<double>(std::max(1, plan.timing.threads)) / std::max(1, cpus));
  // One frame more than the chunk has: the frame that chooses predictors.
  const double frames = static_cast<double>(std::min(plan.chunk_frames, plan.end - plan.begin) + 1);
  const double seconds = plan.timing.start_seconds + frames * plan.timing.slowest_seconds * fewer;
  return static_cast<uint64_t>(std::ceil(seconds * kTimeMargin / 60.0 + kStartMinutes));
}

uint64_t slurm_mebibytes(const Plan& plan) {
  if (plan.timing.peak_bytes == 0) return kDefaultMemory;
  const double wanted = kMemoryMargin * static_cast<double>(plan.timing.peak_bytes) / (1 << 20);
  return (static_cast<uint64_t>(wanted) / kMemoryStep + 1) * kMemoryStep;
}

std::string slurm_array_script(const WorkFolder& folder, const SlurmOptions& options,
                               const std::string& program, const std::string& list) {
  const Plan& plan = folder.plan();
  const int cpus = cpus_of(plan, options);
  std::string text = script_head(job_name(plan, "chunks"), options);
  text += fmt::format("#SBATCH --cpus-per-task={}\n", cpus);
  text += fmt::format("#SBATCH --mem={}\n", options.memory.empty()
                                                ? fmt::format("{}M", slurm_mebibytes(plan))
                                                : options.memory);
  text += fmt::format("#SBATCH --time={}\n", options.time.empty()
                                                 ? fmt::format("{}", slurm_minutes(plan, cpus))
                                                 : options.time);
  text += "#SBATCH --output=slurm/logs/%A_%a.log\n";
  text += fmt::format("chunk=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {})\n", shell_quoted(list));
  text +=
      fmt::format("exec {} farm render {} \"$chunk\" --threads \"${{SLURM_CPUS_PER_TASK:-{}}}\"\n",
                  shell_quoted(program), shell_quoted(folder.path().string()), cpus);
  return text;
}

std::string slurm_merge_script(const WorkFolder& folder, const SlurmOptions& options,
                               const std::string& program) {
  std::string text = script_head(job_name(folder.plan(), "merge"), options);
  text += "#SBATCH --cpus-per-task=1\n#SBATCH --mem=512M\n";
  text += "#SBATCH --output=slurm/logs/merge-%j.log\n";
  text += fmt::format("exec {} farm merge {} --wait {}\n", shell_quoted(program),
                      shell_quoted(folder.path().string()), kMergeWaitSeconds);
  return text;
}

std::vector<std::string> slurm_array_arguments(const WorkFolder& folder,
                                               const SlurmOptions& options, size_t tasks) {
  std::vector<std::string> arguments = common_arguments(folder, options);
  const std::string limit = options.array_limit > 0 ? fmt::format("%{}", options.array_limit) : "";
  arguments.push_back(fmt::format("--array=0-{}{}", tasks - 1, limit));
  return arguments;
}

std::vector<std::string> slurm_merge_arguments(const WorkFolder& folder,
                                               const SlurmOptions& options,
                                               const std::vector<uint64_t>& after) {
  std::vector<std::string> arguments = common_arguments(folder, options);
  // afterany, not afterok: after a failure, the merge names the chunks that are missing.
  if (!after.empty())
    arguments.push_back(fmt::format("--dependency=afterany:{}", fmt::join(after, ":")));
  return arguments;
}

std::optional<uint64_t> parse_sbatch_id(std::string_view output) {
  std::string_view line = trimmed(next_line(output));
  return number_from<uint64_t>(take_until(line, ';'));
}

uint64_t parse_max_array_size(std::string_view output) {
  while (!output.empty()) {
    std::string_view line = next_line(output);
    if (trimmed(take_until(line, '=')) != "MaxArraySize") continue;
    const auto size = number_from<uint64_t>(trimmed(line));
    if (size && *size > 0) return *size;
  }
  return kDefaultArraySize;
}

std::string slurm_jobs_to_json(const SlurmJobs& jobs) {
  json list = json::array();
  for (const SlurmJob& job : jobs.arrays) list.push_back({{"id", job.id}, {"chunks", job.chunks}});
  return json_text(json{{"jobs", list}, {"merge", jobs.merge}, {"folder", jobs.folder}}) + "\n";
}

SlurmJobs parse_slurm_jobs(std::string_view text, const std::string& source) {
  const json object = optics::parse_json(text, source);
  const optics::JsonFields fields(object, source);
  const json& list = fields.need("jobs");
  if (!list.is_array()) fields.fail("jobs", "not a list");
  SlurmJobs jobs{.merge = fields.whole("merge", UINT64_MAX), .folder = fields.text("folder")};
  for (const json& one : list) {
    const optics::JsonFields job(one, source);
    const json& chunks = job.need("chunks");
    if (!chunks.is_array()) job.fail("chunks", "not a list");
    jobs.arrays.push_back({.id = job.whole("id", UINT64_MAX)});
    for (const json& chunk : chunks) {
      if (!chunk.is_number_unsigned()) job.fail("chunks", "not a list of numbers");
      jobs.arrays.back().chunks.push_back(chunk.get<uint64_t>());
    }
  }
  return jobs;
}

namespace {

constexpr size_t kFields = 5;
constexpr size_t kChunksShown = 60;  ///< characters

/// Returns a reason without the differences between versions of Slurm.
std::string plain(std::string_view reason) {
  std::string text;
  for (const char c : reason)
    text += c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

TaskState state_of(std::string_view state, std::string_view reason) {
  if (state == "R" || state == "CG" || state == "CF") return TaskState::Running;
  const std::string text = plain(reason);
  if (text == "launch failed requeued held" || text == "jobholdmaxrequeue")
    return TaskState::HeldBySlurm;
  const bool held = text.find("held") != std::string::npos;
  return held ? TaskState::HeldByPerson : TaskState::Waiting;
}

std::optional<QueuedTask> parse_line(std::string_view line, std::string_view folder) {
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

bool starts_by_itself(TaskState state) {
  return state == TaskState::Running || state == TaskState::Waiting;
}

std::string chunks_text(const SlurmQueue& queue, TaskState state) {
  std::vector<uint64_t> chunks;
  for (const auto& [chunk, task] : queue.chunks)
    if (task.state == state) chunks.push_back(chunk);
  std::string text = chunks.empty() ? "" : "chunks " + shortened(ranges_text(chunks), kChunksShown);
  if (queue.merge && queue.merge->state == state) text += text.empty() ? "merge" : " and merge";
  return text;
}

std::string reasons_text(const std::vector<QueuedTask>& tasks) {
  std::set<std::string> reasons;
  for (const QueuedTask& task : tasks) reasons.insert(escaped(task.reason));
  std::string text;
  for (const std::string& reason : reasons) text += (text.empty() ? "" : ", ") + reason;
  return text;
}

std::string held_text(const SlurmQueue& queue, TaskState state, const char* holder) {
  const std::vector<QueuedTask> held = queue.tasks(state);
  return held.empty() ? ""
                      : fmt::format("held by {}: {} ({})\n", holder, chunks_text(queue, state),
                                    reasons_text(held));
}

json held_json(const SlurmQueue& queue) {
  json list = json::array();
  const auto add = [&](const QueuedTask& task, const json& chunk) {
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

}  // namespace

std::string QueuedTask::name() const {
  return task ? fmt::format("{}_{}", job, *task) : fmt::format("{}", job);
}

std::vector<QueuedTask> parse_queue(std::string_view output, std::string_view folder) {
  std::vector<QueuedTask> tasks;
  while (!output.empty()) {
    const auto task = parse_line(take_until(output, '\n'), folder);
    if (task) tasks.push_back(*task);
  }
  return tasks;
}

std::vector<QueuedTask> SlurmQueue::tasks(TaskState state) const {
  std::vector<QueuedTask> found;
  for (const auto& [chunk, task] : chunks)
    if (task.state == state) found.push_back(task);
  if (merge && merge->state == state) found.push_back(*merge);
  return found;
}

SlurmQueue queue_of_film(const SlurmJobs& jobs, const std::vector<QueuedTask>& queue) {
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

json queue_json(const SlurmQueue& queue) {
  return {{"running", queue.tasks(TaskState::Running).size()},
          {"waiting", queue.tasks(TaskState::Waiting).size()},
          {"held", held_json(queue)}};
}

std::string queue_text(const SlurmQueue& queue, const std::string& folder) {
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
