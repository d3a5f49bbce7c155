// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/farm/slurm_programs.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "player/process/child_process.h"

namespace lenticule::tools {
namespace {

constexpr uint64_t kMostJobsBytes = uint64_t{64} << 20;

}  // namespace

std::string run_slurm(const std::string& name, const std::vector<std::string>& arguments,
                      std::chrono::seconds limit) {
  const auto path = player::find_program(name);
  if (!path)
    throw Error(ErrorKind::Failed, fmt::format("{}: not found in PATH", name),
                "install Slurm's client programs, or use another engine: each line of commands.txt "
                "is a command");
  std::vector<std::string> words = {*path};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const ProgramRun run = player::run_child(words, limit);
  if (run.exit_code == 0) return run.output;
  if (run.timed_out)
    throw Error(ErrorKind::Failed, fmt::format("{}: does not answer", name),
                "see whether Slurm's controller runs: scontrol ping");
  throw Error(ErrorKind::Failed, fmt::format("{}: {}", name, escaped(shortened(run.output, 400))));
}

std::filesystem::path slurm_jobs_file(const farm::WorkFolder& folder) {
  return folder.path() / "slurm" / "jobs.json";
}

std::optional<farm::SlurmJobs> submitted_jobs(const farm::WorkFolder& folder) {
  const std::filesystem::path file = slurm_jobs_file(folder);
  std::error_code none;
  if (!std::filesystem::exists(file, none)) return std::nullopt;
  return farm::parse_slurm_jobs(read_text_file(file, kMostJobsBytes), file.string());
}

farm::SlurmQueue ask_slurm(const farm::SlurmJobs& jobs, std::chrono::seconds limit) {
  const std::string output = run_slurm(
      "squeue", {"--noheader", "--array", fmt::format("--format={}", farm::kQueueFormat)}, limit);
  return farm::queue_of_film(jobs, farm::parse_queue(output, jobs.folder));
}

}  // namespace lenticule::tools
