// SPDX-License-Identifier: Apache-2.0
#include "farm/slurm.h"

#include <gtest/gtest.h>

#include <fstream>

#include "small_farm.h"
#include "tests/support/process.h"

namespace lenticule::farm {
namespace {

using test::small_plan;
using test::SmallFarm;

TEST(Slurm, TimeAndMemoryComeFromTheTimedFrames) {
  const Plan plan = small_plan(0, 100, 10);  // 12 s for the slowest frame, 700 MiB, 4 threads
  // 11 frames and the start, three times, and five minutes.
  EXPECT_EQ(slurm_minutes(plan, 4), 12U);
  EXPECT_GT(slurm_minutes(plan, 1), 3 * slurm_minutes(plan, 4) - 15);
  EXPECT_EQ(slurm_mebibytes(plan), 1280U);
  Plan untimed = plan;
  untimed.timing = {};
  EXPECT_EQ(slurm_minutes(untimed, 4), 24U * 60U);
  EXPECT_EQ(slurm_mebibytes(untimed), 4096U);
}

TEST(Slurm, TheArrayScriptHasTheFlags) {
  const SmallFarm farm(small_plan(0, 100, 10));
  const std::string script = slurm_array_script(
      farm.folder(), {.partition = "film", .time = "2:00:00", .memory = "8G", .cpus = 16},
      "/opt/my tools/lenticule", "slurm/chunks-1.txt");
  for (const char* line :
       {"#!/bin/sh\n", "#SBATCH --partition=film\n", "#SBATCH --time=2:00:00\n",
        "#SBATCH --mem=8G\n", "#SBATCH --cpus-per-task=16\n", "#SBATCH --requeue\n",
        "#SBATCH --open-mode=append\n", "exec '/opt/my tools/lenticule' farm render "})
    EXPECT_NE(script.find(line), std::string::npos) << line << " in " << script;
  EXPECT_EQ(script.rfind("#!/bin/sh\n", 0), 0U);
}

/// Runs the script with a stand-in for lenticule.
TEST(Slurm, TaskIOfTheArrayRendersTheChunkInLineIOfTheList) {
  const SmallFarm farm(small_plan(0, 100, 10));
  std::filesystem::create_directories(farm.work() / "slurm");
  std::ofstream(farm.work() / "slurm" / "list.txt") << "3\n8\n9\n";
  const std::string script = slurm_array_script(farm.folder(), {}, "/bin/echo", "slurm/list.txt");
  std::ofstream(farm.work() / "script.sh") << script;
  const test::ProcessResult result = test::run_process(
      {"/bin/sh", "-c", "cd \"$1\" && SLURM_ARRAY_TASK_ID=1 sh script.sh", "sh", farm.work()});
  EXPECT_EQ(result.out, "farm render " + farm.work().string() + " 8 --threads 4\n");
}

TEST(Slurm, TheMergeWaitsForAllJobs) {
  const SmallFarm farm(small_plan(0, 100, 10));
  const auto arguments = slurm_merge_arguments(farm.folder(), {}, {7, 9});
  EXPECT_EQ(arguments.back(), "--dependency=afterany:7:9");
  const auto array =
      slurm_array_arguments(farm.folder(), {.array_limit = 3, .more = {"-A", "x"}}, 5);
  EXPECT_EQ(array.back(), "--array=0-4%3");
  EXPECT_EQ(array.front(), "--parsable");
}

TEST(Slurm, ReadsWhatItsProgramsPrint) {
  EXPECT_EQ(parse_sbatch_id("123\n"), 123U);
  EXPECT_EQ(parse_sbatch_id("123;cluster\n"), 123U);
  EXPECT_FALSE(parse_sbatch_id("sbatch: error: no\n"));
  EXPECT_EQ(parse_max_array_size("A = 1\nMaxArraySize            = 4001\nB = 2\n"), 4001U);
  EXPECT_EQ(parse_max_array_size("nothing"), 1001U);
}

TEST(Slurm, JobsAreTheSameAfterWritingAndReading) {
  const std::string text =
      slurm_jobs_to_json({.arrays = {{5, {1, 2}}, {6, {}}}, .merge = 7, .folder = "/srv/work"});
  const SlurmJobs jobs = parse_slurm_jobs(text, "jobs");
  ASSERT_EQ(jobs.arrays.size(), 2U);
  EXPECT_EQ(jobs.arrays[0].id, 5U);
  EXPECT_EQ(jobs.arrays[0].chunks, (std::vector<uint64_t>{1, 2}));
  EXPECT_EQ(jobs.merge, 7U);
  EXPECT_EQ(jobs.folder, "/srv/work");
}

}  // namespace
}  // namespace lenticule::farm
