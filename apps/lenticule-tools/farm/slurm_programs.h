// SPDX-License-Identifier: Apache-2.0
// Calls the programs of Slurm for a work folder.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "farm/slurm.h"
#include "farm/work_folder.h"

namespace lenticule::tools {

/// Runs a program of Slurm that is in PATH, and returns what it prints. Throws Error(Failed) if it
/// is not installed, fails or does not answer.
[[nodiscard]] std::string run_slurm(const std::string& name,
                                    const std::vector<std::string>& arguments,
                                    std::chrono::seconds limit = std::chrono::seconds(60));

/// Returns the file with the jobs of a work folder.
[[nodiscard]] std::filesystem::path slurm_jobs_file(const farm::WorkFolder& folder);
/// Returns the jobs that were submitted for a work folder; none if there was no submission. Throws
/// Error(Input).
[[nodiscard]] std::optional<farm::SlurmJobs> submitted_jobs(const farm::WorkFolder& folder);

/// Asks Slurm which of the jobs are in its queue. Throws Error(Failed).
[[nodiscard]] farm::SlurmQueue ask_slurm(const farm::SlurmJobs& jobs,
                                         std::chrono::seconds limit = std::chrono::seconds(60));

}  // namespace lenticule::tools
