// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm_queue.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <set>

#include "base/numbers.h"
#include "base/text.h"
#include "farm/merge.h"

namespace lenticule::farm {
namespace {

using nlohmann::json;

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
