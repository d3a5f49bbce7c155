// SPDX-License-Identifier: Apache-2.0
#include "player/process/child_process.h"

#include <gtest/gtest.h>

#include <csignal>

#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

TEST(ChildProcess, IsEndedWhenThisProcessIsInterrupted) {
  install_interrupt_handlers();
  std::raise(SIGTERM);
  const ProgramRun result = run_child({"/bin/sleep", "600"}, std::chrono::seconds(600));
  EXPECT_FALSE(result.timed_out);
  EXPECT_EQ(result.exit_code, -1);
}

TEST(FindProgram, LooksInThePath) {
  EXPECT_TRUE(find_program("sh").has_value());
  EXPECT_EQ(find_program("no-program-is-called-this"), std::nullopt);
}

}  // namespace
}  // namespace lenticule::player
