// SPDX-License-Identifier: Apache-2.0
// lenticule farm submit gives the chunks that are not done, and the merge, to Slurm.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "apps/lenticule-tools/farm/farm_actions.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "base/text.h"
#include "farm/work_folder.h"
#include "player/process/child_process.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kSlurmLimit{60};
constexpr uint64_t kMostJobsBytes = uint64_t{64} << 20;

std::string slurm_program(const std::string& name) {
  const auto path = find_program(name);
  if (!path)
    throw Error(ErrorKind::Failed, fmt::format("{}: not found in PATH", name),
                "install Slurm's client programs, or use another engine: each line of commands.txt "
                "is a command");
  return *path;
}

/// Returns what a program of Slurm prints. Throws Error(Failed) with it if the program fails.
std::string run_slurm(const std::vector<std::string>& arguments) {
  const ProgramRun run = run_child(arguments, kSlurmLimit);
  if (run.exit_code == 0) return run.output;
  throw Error(ErrorKind::Failed,
              fmt::format("{}: {}", fs::path(arguments.front()).filename().string(),
                          escaped(shortened(run.output, 400))),
              run.timed_out ? "Slurm does not answer" : "");
}

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
        program_(farm_program(flags.program)),
        jobs_file_(folder_.path() / "slurm" / "jobs.json") {
    std::error_code none;
    if (fs::exists(jobs_file_, none))
      jobs_ =
          farm::parse_slurm_jobs(read_text_file(jobs_file_, kMostJobsBytes), jobs_file_.string());
  }

  ExitCode run() {
    std::vector<uint64_t> chunks = missing_in_order();
    const size_t missing = chunks.size();
    if (!flags_.dry_run) remove_queued(chunks);
    if (missing > 0 && chunks.empty()) {
      say("all {} missing chunks are in Slurm's queue\n", missing);
      return report(chunks.size());
    }
    if (!flags_.dry_run) create_folders();
    const uint64_t most = flags_.dry_run ? 1001 : max_array_size();
    for (size_t at = 0; at < chunks.size(); at += most)
      submit_array({chunks.begin() + static_cast<std::ptrdiff_t>(at),
                    chunks.begin() +
                        static_cast<std::ptrdiff_t>(std::min<size_t>(chunks.size(), at + most))});
    submit_merge();
    return report(chunks.size());
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
    return farm::parse_max_array_size(run_slurm({slurm_program("scontrol"), "show", "config"}));
  }

  /// Removes the chunks that an earlier call submitted and that wait or run, and keeps the numbers
  /// of their jobs.
  void remove_queued(std::vector<uint64_t>& chunks) {
    if (jobs_.empty() || chunks.empty()) return;
    const auto queue = farm::parse_queue(
        run_slurm({slurm_program("squeue"), "--noheader", "--array", "--format=%F %K"}));
    std::set<uint64_t> queued;
    for (const farm::SlurmJob& job : jobs_) {
      bool active = false;
      for (size_t task = 0; task < job.chunks.size(); ++task) {
        if (queue.count({job.id, task}) == 0) continue;
        queued.insert(job.chunks[task]);
        active = true;
      }
      if (active) after_.push_back(job.id);
    }
    std::erase_if(chunks, [&](uint64_t chunk) { return queued.count(chunk) > 0; });
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
    arguments.insert(arguments.begin(), slurm_program("sbatch"));
    const std::string output = run_slurm(arguments);
    const auto id = farm::parse_sbatch_id(output);
    if (!id)
      throw Error(ErrorKind::Failed, fmt::format("sbatch: printed no job number: {}",
                                                 escaped(shortened(output, 200))));
    return *id;
  }

  void submit_array(const std::vector<uint64_t>& chunks) {
    const size_t number = jobs_.size() + 1;
    const std::string list = fmt::format("slurm/chunks-{}.txt", number);
    if (!flags_.dry_run)
      write_text_file(folder_.path() / list, fmt::format("{}\n", fmt::join(chunks, "\n")));
    const uint64_t id = submit(fmt::format("array-{}.sh", number),
                               farm::slurm_array_script(folder_, flags_.options, program_, list),
                               farm::slurm_array_arguments(folder_, flags_.options, chunks.size()));
    jobs_.push_back({.id = id, .chunks = chunks});
    if (flags_.dry_run) return;
    after_.push_back(id);
    new_jobs_.push_back(id);
    write_text_file(jobs_file_, farm::slurm_jobs_to_json(jobs_));
  }

  void submit_merge() {
    std::vector<std::string> arguments =
        farm::slurm_merge_arguments(folder_, flags_.options, after_);
    if (flags_.dry_run) arguments.emplace_back("--dependency=afterany:ARRAY_JOBS");
    merge_job_ = submit("merge.sh", farm::slurm_merge_script(folder_, flags_.options, program_),
                        std::move(arguments));
  }

  ExitCode report(size_t chunks) const {
    if (flags_.dry_run) return kOk;
    if (flags_.json) {
      print_json({{"chunks_submitted", chunks},
                  {"chunks", folder_.plan().chunks()},
                  {"array_jobs", new_jobs_},
                  {"merge_job", merge_job_ == 0 ? nlohmann::json() : nlohmann::json(merge_job_)}});
      return kOk;
    }
    for (const uint64_t job : new_jobs_) print_out("array job {}\n", job);
    if (merge_job_ != 0) print_out("merge job {}\n", merge_job_);
    print_out("{} of {} chunks submitted\n", chunks, folder_.plan().chunks());
    return kOk;
  }

  const FarmSubmitFlags& flags_;
  farm::WorkFolder folder_;
  std::string program_;
  fs::path jobs_file_;
  std::vector<farm::SlurmJob> jobs_;
  std::vector<uint64_t> after_;  ///< jobs for which the merge waits
  std::vector<uint64_t> new_jobs_;
  uint64_t merge_job_ = 0;
};

}  // namespace

ExitCode farm_submit(const FarmSubmitFlags& flags) {
  if (!flags.slurm)
    throw Error(ErrorKind::Usage, "farm submit: no engine requested",
                "--slurm submits to Slurm; other engines run the lines of commands.txt");
  return SubmitRun(flags).run();
}

}  // namespace lenticule::player
