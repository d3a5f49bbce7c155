// SPDX-License-Identifier: Apache-2.0
// lenticule farm submit gives the chunks to Slurm, and lenticule farm status shows how far they
// are.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "apps/lenticule-tools/farm/actions.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "base/text.h"
#include "farm/work_folder.h"
#include "player/process/child_process.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {

namespace {

constexpr uint64_t kMostJobsBytes = uint64_t{64} << 20;

/// Runs a program of Slurm that is in PATH, and returns what it prints. Throws Error(Failed) if it
/// is not installed, fails or does not answer.
std::string run_slurm(const std::string& name, const std::vector<std::string>& arguments,
                      std::chrono::seconds limit = std::chrono::seconds(60)) {
  const auto path = player::find_program(name);
  if (!path)
    throw failed_error("{}: not found in PATH", name)
        .remedy(
            "install Slurm's client programs, or use another engine: each line of commands.txt "
            "is a command");
  std::vector<std::string> words = {*path};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const ProgramRun run = player::run_child(words, limit);
  if (run.exit_code == 0) return run.output;
  if (run.timed_out)
    throw failed_error("{}: does not answer", name)
        .remedy("see whether Slurm's controller runs: scontrol ping");
  throw failed_error("{}: {}", name, escaped(shortened(run.output, 400)));
}

/// Returns the file with the jobs of a work folder.
std::filesystem::path slurm_jobs_file(const farm::WorkFolder& folder) {
  return folder.path() / "slurm" / "jobs.json";
}

/// Returns the jobs that were submitted for a work folder; none if there was no submission. Throws
/// Error(Input).
std::optional<farm::SlurmJobs> submitted_jobs(const farm::WorkFolder& folder) {
  const std::filesystem::path file = slurm_jobs_file(folder);
  std::error_code none;
  if (!std::filesystem::exists(file, none)) return std::nullopt;
  return farm::parse_slurm_jobs(read_text_file(file, kMostJobsBytes), file.string());
}

/// Asks Slurm which of the jobs are in its queue. Throws Error(Failed).
farm::SlurmQueue ask_slurm(const farm::SlurmJobs& jobs,
                           std::chrono::seconds limit = std::chrono::seconds(60)) {
  const std::string output = run_slurm(
      "squeue", {"--noheader", "--array", fmt::format("--format={}", farm::kQueueFormat)}, limit);
  return farm::queue_of_film(jobs, farm::parse_queue(output, jobs.folder));
}

// lenticule farm submit gives the chunks that are not done, and the merge, to Slurm.

namespace fs = std::filesystem;

std::string command_line(const std::vector<std::string>& words) {
  std::vector<std::string> quoted;
  for (const std::string& word : words) quoted.push_back(shell_quoted(word));
  return fmt::format("{}", fmt::join(quoted, " "));
}

/// SubmitRun submits array jobs of at most as many tasks as Slurm allows, then the merge.
class SubmitRun {
 public:
  explicit SubmitRun(const FarmFlags& flags)
      : flags_(flags),
        folder_(fs::absolute(flags.folder).lexically_normal()),
        program_(farm_program(flags.program)) {
    if (const auto jobs = submitted_jobs(folder_)) jobs_ = *jobs;
  }

  ExitCode run() {
    std::vector<uint64_t> chunks = farm::chunk_order(folder_.plan());
    std::erase_if(chunks, [&](uint64_t chunk) { return folder_.done(chunk).has_value(); });
    if (!flags_.dry_run && !jobs_.arrays.empty()) continue_queued(chunks);
    submitted_ = chunks.size();
    if (chunks.empty() && merge_waits_) return report();
    if (!flags_.dry_run) farm::create_folders(folder_.path() / "slurm" / "logs");
    jobs_.folder = folder_.path().string();
    const uint64_t most =
        flags_.dry_run ? farm::kDefaultArraySize
                       : farm::parse_max_array_size(run_slurm("scontrol", {"show", "config"}));
    for (size_t at = 0; at < chunks.size(); at += most)
      submit_array({chunks.begin() + static_cast<std::ptrdiff_t>(at),
                    chunks.begin() +
                        static_cast<std::ptrdiff_t>(std::min<size_t>(chunks.size(), at + most))});
    submit_merge();
    return report();
  }

 private:
  /// Lets a task start that Slurm holds. Where only an administrator may release it, the task is
  /// cancelled and taken out of the queue, so that its chunk or the merge is submitted again.
  void release(const farm::QueuedTask& task, farm::SlurmQueue& queue) {
    try {
      (void)run_slurm("scontrol", {"release", task.name()});
      say("task {}: Slurm held it ({}); released\n", task.name(), task.reason);
      ++released_;
      return;
    } catch (const Error& refusal) {
      say("task {}: Slurm holds it ({}) and does not release it ({}); cancelled\n", task.name(),
          task.reason, refusal.what());
    }
    (void)run_slurm("scancel", {task.name()});
    ++cancelled_;
    std::erase_if(queue.chunks,
                  [&](const auto& chunk) { return chunk.second.name() == task.name(); });
    if (queue.merge && queue.merge->name() == task.name()) queue.merge.reset();
  }

  /// Removes the chunks that an earlier call submitted and that wait or run. Releases tasks that
  /// Slurm holds, also of chunks that are done, since the merge waits for all tasks.
  void continue_queued(std::vector<uint64_t>& chunks) {
    farm::SlurmQueue queue = ask_slurm(jobs_);
    for (const farm::QueuedTask& task : queue.tasks(farm::TaskState::HeldBySlurm))
      release(task, queue);
    for (const farm::QueuedTask& task : queue.tasks(farm::TaskState::HeldByPerson))
      say("task {}: held by a person ({}); scontrol release {} lets it start\n", task.name(),
          task.reason, task.name());
    std::erase_if(chunks, [&](uint64_t chunk) { return queue.chunks.count(chunk) > 0; });
    queued_ = queue.chunks.size();
    merge_waits_ = queue.merge.has_value();
    std::set<uint64_t> active;
    for (const auto& [chunk, task] : queue.chunks) active.insert(task.job);
    after_.assign(active.begin(), active.end());
  }

  /// Submits a script, or prints it. Returns the number of the job.
  uint64_t submit(const std::string& name, const std::string& script,
                  std::vector<std::string> arguments) {
    const fs::path file = folder_.path() / "slurm" / name;
    arguments.push_back(file.string());
    if (flags_.dry_run) {
      arguments.insert(arguments.begin(), "sbatch");
      print_out("# {}\n{}\n# {}\n\n", file.string(), Verbatim{script},
                Verbatim{command_line(arguments)});
      return 0;
    }
    write_text_file(file, script);
    const std::string output = run_slurm("sbatch", arguments);
    const auto id = farm::parse_sbatch_id(output);
    if (!id)
      throw failed_error("sbatch: printed no job number: {}", escaped(shortened(output, 200)));
    return *id;
  }

  void submit_array(const std::vector<uint64_t>& chunks) {
    const size_t number = jobs_.arrays.size() + 1;
    const std::string list = fmt::format("slurm/chunks-{}.txt", number);
    if (!flags_.dry_run)
      write_text_file(folder_.path() / list, fmt::format("{}\n", fmt::join(chunks, "\n")));
    const uint64_t id = submit(fmt::format("array-{}.sh", number),
                               farm::slurm_array_script(folder_, flags_.options, program_, list),
                               farm::slurm_array_arguments(folder_, flags_.options, chunks.size()));
    jobs_.arrays.push_back({.id = id, .chunks = chunks});
    if (flags_.dry_run) return;
    after_.push_back(id);
    new_jobs_.push_back(id);
    write_jobs();
  }

  void submit_merge() {
    std::vector<std::string> arguments =
        farm::slurm_merge_arguments(folder_, flags_.options, after_);
    if (flags_.dry_run) arguments.emplace_back("--dependency=afterany:ARRAY_JOBS");
    merge_job_ = submit("merge.sh", farm::slurm_merge_script(folder_, flags_.options, program_),
                        std::move(arguments));
    if (flags_.dry_run) return;
    jobs_.merge = merge_job_;
    write_jobs();
  }

  void write_jobs() const {
    write_text_file(slurm_jobs_file(folder_), farm::slurm_jobs_to_json(jobs_));
  }

  [[nodiscard]] ExitCode report() const {
    if (flags_.dry_run) return kOk;
    if (flags_.json) {
      print_json({{"chunks_submitted", submitted_},
                  {"tasks_in_queue", queued_},
                  {"tasks_released", released_},
                  {"tasks_cancelled", cancelled_},
                  {"chunks", folder_.plan().chunks()},
                  {"array_jobs", new_jobs_},
                  {"merge_job", merge_job_ == 0 ? nlohmann::json() : nlohmann::json(merge_job_)}});
      return kOk;
    }
    for (const uint64_t job : new_jobs_) print_out("array job {}\n", job);
    if (merge_job_ != 0) print_out("merge job {}\n", merge_job_);
    if (queued_ > 0) print_out("{} tasks are in Slurm's queue already\n", queued_);
    if (released_ > 0) print_out("{} tasks that Slurm held are released\n", released_);
    if (cancelled_ > 0) print_out("{} tasks that Slurm kept held are cancelled\n", cancelled_);
    print_out("{} of {} chunks submitted\n", submitted_, folder_.plan().chunks());
    return kOk;
  }

  const FarmFlags& flags_;
  farm::WorkFolder folder_;
  std::string program_;
  farm::SlurmJobs jobs_;
  std::vector<uint64_t> after_;  ///< jobs for which the merge waits
  std::vector<uint64_t> new_jobs_;
  size_t submitted_ = 0;      ///< chunks
  size_t queued_ = 0;         ///< tasks of earlier calls
  size_t released_ = 0;       ///< tasks
  size_t cancelled_ = 0;      ///< tasks that Slurm did not release
  bool merge_waits_ = false;  ///< a merge of an earlier call is in the queue
  uint64_t merge_job_ = 0;
};

constexpr std::chrono::seconds kWatchPause{2};

/// QueueLook asks Slurm for the film's tasks if they were submitted to it. The queue of a large
/// cluster costs its controller some work, so that --watch asks seldom.
class QueueLook {
 public:
  explicit QueueLook(const farm::WorkFolder& folder) : folder_(folder) {}

  /// Returns "slurm" of the JSON, and the same as lines. Without a submission, or after the merge,
  /// both are empty.
  [[nodiscard]] std::pair<nlohmann::json, std::string> look(const farm::FarmStatus& status) {
    if (status.complete() && status.merged) return {};
    const auto now = std::chrono::steady_clock::now();
    if (asked_ && now - *asked_ < kAskAgain) return answer_;
    asked_ = now;
    try {
      const auto jobs = submitted_jobs(folder_);
      if (!jobs) return answer_ = {};
      const farm::SlurmQueue queue = ask_slurm(*jobs, kSlurmLimit);
      answer_ = {farm::queue_json(queue), farm::queue_text(queue, folder_.path().string())};
    } catch (const Error& error) {  // the files still say how far the farm is
      answer_ = {{{"error", error.what()}}, fmt::format("Slurm: {}\n", escaped(error.what()))};
    }
    return answer_;
  }

 private:
  static constexpr std::chrono::seconds kAskAgain{20};
  static constexpr std::chrono::seconds kSlurmLimit{5};
  const farm::WorkFolder& folder_;
  std::optional<std::chrono::steady_clock::time_point> asked_;
  std::pair<nlohmann::json, std::string> answer_;
};

void print_status(const farm::FarmStatus& status, QueueLook& queue, bool json) {
  const auto [object, lines] = queue.look(status);
  if (!json) return print_out("{}{}", Verbatim{farm::status_text(status)}, Verbatim{lines});
  nlohmann::json out = farm::status_json(status);
  out["slurm"] = object;
  print_json(out);
}

}  // namespace

ExitCode farm_submit(const FarmFlags& flags) {
  if (!flags.slurm)
    throw Error(ErrorKind::Usage, "farm submit: no engine requested",
                "--slurm submits to Slurm; other engines run the lines of commands.txt");
  return SubmitRun(flags).run();
}

// lenticule farm status shows how far a farm is, from the files of its work folder; and, if Slurm
// runs it, which tasks Slurm holds.

ExitCode farm_status(const FarmFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  QueueLook queue(folder);
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  while (true) {
    const farm::FarmStatus status = farm::read_status(folder, farm::folder_time(folder.path()));
    if (flags.watch && terminal && !flags.json) print_out("{}", Verbatim{"\x1b[H\x1b[2J"});
    print_status(status, queue, flags.json);
    if (!flags.watch || status.complete()) return kOk;
    flush_results();
    if (!player::wait_unless_interrupted(kWatchPause)) return player::interrupt_exit_code();
  }
}
}  // namespace lenticule::tools
