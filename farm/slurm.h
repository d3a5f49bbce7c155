// SPDX-License-Identifier: Apache-2.0
// Texts for Slurm: scripts and arguments of sbatch, and what its commands print.
#pragma once

#include <cstdint>
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

}  // namespace lenticule::farm
