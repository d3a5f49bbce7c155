// SPDX-License-Identifier: Apache-2.0
// lenticule farm submit gives the chunks that are not done, and the merge, to Slurm.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/farm/slurm_programs.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "base/text.h"
#include "farm/work_folder.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

std::string command_line(const std::vector<std::string>& words) {
  std::vector<std::string> quoted;
  for (const std::string& word : words) quoted.push_back(shell_quoted(word));
  return fmt::format("{}", fmt::join(quoted, " "));
}

/// SubmitRun submits array jobs of at most as many tasks as Slurm allows, then the merge.
class SubmitRun {
 public:
  explicit SubmitRun(const FarmSubmitFlags& flags)
      : flags_(flags),
        folder_(fs::absolute(flags.folder).lexically_normal()),
        program_(farm_program(flags.program)) {
    if (const auto jobs = submitted_jobs(folder_)) jobs_ = *jobs;
  }

  ExitCode run() {
    std::vector<uint64_t> chunks = missing_in_order();
    if (!flags_.dry_run && !jobs_.arrays.empty()) continue_queued(chunks);
    submitted_ = chunks.size();
    if (chunks.empty() && merge_waits_) return report();
    if (!flags_.dry_run) create_folders();
    jobs_.folder = folder_.path().string();
    const uint64_t most = flags_.dry_run ? farm::kDefaultArraySize : max_array_size();
    for (size_t at = 0; at < chunks.size(); at += most)
      submit_array({chunks.begin() + static_cast<std::ptrdiff_t>(at),
                    chunks.begin() +
                        static_cast<std::ptrdiff_t>(std::min<size_t>(chunks.size(), at + most))});
    submit_merge();
    return report();
  }

 private:
  [[nodiscard]] std::vector<uint64_t> missing_in_order() const {
    std::vector<uint64_t> chunks = farm::chunk_order(folder_.plan());
    std::erase_if(chunks, [&](uint64_t chunk) { return folder_.done(chunk).has_value(); });
    return chunks;
  }

  void create_folders() const {
    std::error_code error;
    fs::create_directories(folder_.path() / "slurm" / "logs", error);
    if (error)
      throw Error(ErrorKind::Failed,
                  fmt::format("{}: cannot create: {}", (folder_.path() / "slurm/logs").string(),
                              error.message()));
  }

  static uint64_t max_array_size() {
    return farm::parse_max_array_size(run_slurm("scontrol", {"show", "config"}));
  }

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
      throw Error(ErrorKind::Failed, fmt::format("sbatch: printed no job number: {}",
                                                 escaped(shortened(output, 200))));
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

  const FarmSubmitFlags& flags_;
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

}  // namespace

ExitCode farm_submit(const FarmSubmitFlags& flags) {
  if (!flags.slurm)
    throw Error(ErrorKind::Usage, "farm submit: no engine requested",
                "--slurm submits to Slurm; other engines run the lines of commands.txt");
  return SubmitRun(flags).run();
}

}  // namespace lenticule::tools
