// SPDX-License-Identifier: Apache-2.0
#include "player/process/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::player {
namespace {

using std::chrono::seconds;

ChildResult shell(const char* script, seconds limit = seconds(60)) {
  return run_child({"/bin/sh", "-c", script}, limit);
}

TEST(ChildProcess, KeepsBothStreamsAndTheExitCode) {
  const ChildResult result = shell("echo one; echo two >&2; exit 3");
  EXPECT_EQ(result.output, "one\ntwo\n");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_FALSE(result.timed_out);
}

TEST(ChildProcess, IsEndedAtItsLimit) {
  const ChildResult result = run_child({"/bin/sleep", "600"}, seconds(1));
  EXPECT_TRUE(result.timed_out);
  EXPECT_EQ(result.exit_code, -1);
}

TEST(ChildProcess, HasAnEmptyStandardInput) {
  EXPECT_EQ(shell("cat").output, "");
}

TEST(ChildProcess, KeepsTheEndOfLongOutput) {
  const ChildResult result = shell("head -c 20000000 /dev/zero; echo the end");
  EXPECT_THAT(result.output, ::testing::EndsWith("the end\n"));
  EXPECT_LT(result.output.size(), 10'000'000U);
}

TEST(ChildProcess, MissingProgramIsAnError) {
  EXPECT_THROW((void)run_child({"/nowhere/program"}, seconds(1)), Error);
}

TEST(FindProgram, LooksInThePath) {
  EXPECT_TRUE(find_program("sh").has_value());
  EXPECT_EQ(find_program("no-program-is-called-this"), std::nullopt);
}

}  // namespace
}  // namespace lenticule::player
