// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "farm/slurm.h"

namespace lenticule::farm {
namespace {

const SlurmJobs kJobs{.arrays = {{.id = 12, .chunks = {30, 31, 32}}, {.id = 20, .chunks = {31}}},
                      .merge = 21};

SlurmQueue queue_of(std::string_view output) {
  return queue_of_film(kJobs, parse_queue(output, "/srv/film|1/work"));
}

TEST(SlurmQueue, KnowsTheStateOfEachChunk) {
  const SlurmQueue queue = queue_of(
      "12|0|R|None|/srv/film|1/work\n"
      "12|1|PD|launch failed requeued held|/srv/film|1/work\n"
      "12|2|PD|Resources|/srv/film|1/work\n"
      "21|N/A|PD|Dependency|/srv/film|1/work\n");
  ASSERT_EQ(queue.chunks.size(), 3U);
  EXPECT_EQ(queue.chunks.at(30).state, TaskState::Running);
  EXPECT_EQ(queue.chunks.at(31).state, TaskState::HeldBySlurm);
  EXPECT_EQ(queue.chunks.at(31).name(), "12_1");
  EXPECT_EQ(queue.chunks.at(32).state, TaskState::Waiting);
  ASSERT_TRUE(queue.merge);
  EXPECT_EQ(queue.merge->name(), "21");
}

TEST(SlurmQueue, IgnoresJobsOfOtherFoldersAndBrokenLines) {
  const SlurmQueue queue = queue_of(
      "12|0|R|None|/srv/film|1/other\n"  // the controller gave the number to another user's job
      "12|7|R|None|/srv/film|1/work\n"   // no such task
      "12|N/A|R|None|/srv/film|1/work\n"
      "x|1|R|None|/srv/film|1/work\n"
      "\n|||\n12");
  EXPECT_TRUE(queue.chunks.empty());
  EXPECT_FALSE(queue.merge);
}

TEST(SlurmQueue, TellsTasksThatSlurmHoldsFromThoseThatPeopleHold) {
  const auto state = [](const std::string& reason) {
    return queue_of("12|0|PD|" + reason + "|/srv/film|1/work\n").chunks.at(30).state;
  };
  EXPECT_EQ(state("launch failed requeued held"), TaskState::HeldBySlurm);
  EXPECT_EQ(state("launch_failed_requeued_held"), TaskState::HeldBySlurm);
  EXPECT_EQ(state("JobHoldMaxRequeue"), TaskState::HeldBySlurm);
  EXPECT_EQ(state("JobHeldUser"), TaskState::HeldByPerson);
  EXPECT_EQ(state("JobHeldAdmin"), TaskState::HeldByPerson);
  EXPECT_EQ(state("job requeued in held state"), TaskState::HeldByPerson);
  EXPECT_EQ(state("Priority"), TaskState::Waiting);
}

TEST(SlurmQueue, OfTwoTasksOfAChunkTheOneThatStartsCounts) {
  const std::string held = "12|1|PD|JobHeldUser|/srv/film|1/work\n";
  const std::string waits = "20|0|PD|Resources|/srv/film|1/work\n";
  EXPECT_EQ(queue_of(held + waits).chunks.at(31).name(), "20_0");
  EXPECT_EQ(queue_of(waits + held).chunks.at(31).name(), "20_0");
}

TEST(SlurmQueue, TheTextNamesHeldChunksAndTheRemedy) {
  const SlurmQueue queue = queue_of(
      "12|0|PD|launch failed requeued held|/srv/film|1/work\n"
      "12|1|PD|launch failed requeued held|/srv/film|1/work\n"
      "12|2|PD|JobHeldAdmin|/srv/film|1/work\n"
      "21|N/A|PD|Dependency|/srv/film|1/work\n");
  EXPECT_EQ(queue_text(queue, "/srv/film|1/work"),
            "Slurm: 0 running, 1 waiting (Dependency)\n"
            "held by Slurm: chunks 30-31 (launch failed requeued held)\n"
            "lenticule farm submit '/srv/film|1/work' --slurm releases them\n"
            "held by a person, until scontrol release: chunks 32 (JobHeldAdmin)\n");
  EXPECT_EQ(queue_json(queue).at("held").size(), 3U);
  EXPECT_EQ(queue_json(queue).at("waiting"), 1);
}

}  // namespace
}  // namespace lenticule::farm
