// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "player/process/private_folder.h"
#include "player/session/play_service.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

class StartHistoryTest : public testing::Test {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();
  void write(const std::string& text) const { std::ofstream(folder / "starts") << text; }
};

TEST_F(StartHistoryTest, CountsStartsThatFailedAndKeepsTheReason) {
  StartHistory(folder, seconds(1000)).failed("film/%05d.png: no such file\nreally");
  const StartHistory next(folder, seconds(1001));
  EXPECT_EQ(next.failures(), 1);
  EXPECT_EQ(next.last_reason(), "film/%05d.png: no such file really");
  EXPECT_EQ(StartHistory(folder, seconds(1002)).last_reason(), "") << "a crash has no last words";
}

TEST_F(StartHistoryTest, ForgetsOldStarts) {
  for (int i = 0; i < 5; ++i) (void)StartHistory(folder, seconds(1000 + i));
  EXPECT_EQ(StartHistory(folder, seconds(1003) + kStartsRemembered).failures(), 2);
  EXPECT_EQ(StartHistory(folder, seconds(100'000)).failures(), 0);
}

TEST_F(StartHistoryTest, RemembersFiveStartsEndedByAWatchdog) {
  constexpr int kWatchdogAbortAndPause = 10 + 5 + 1;
  int failures = 0;
  for (int i = 0; i < 6; ++i)
    failures = StartHistory(folder, seconds(1000 + i * kWatchdogAbortAndPause)).failures();
  EXPECT_EQ(failures, 5);
}

TEST_F(StartHistoryTest, IgnoresCorruptFiles) {
  write("yesterday\n\n99999999999999999999999 x\n-5 y\n2000 in the future\n999 right\n1000\n");
  const StartHistory history(folder, seconds(1000));
  EXPECT_EQ(history.failures(), 2);
  EXPECT_EQ(history.last_reason(), "");
  write(std::string(1 << 20, 'x'));
  EXPECT_EQ(StartHistory(folder, seconds(1000)).failures(), 0);
}

TEST_F(StartHistoryTest, WorksWithoutAWritableFolder) {
  EXPECT_EQ(StartHistory({}, seconds(1000)).failures(), 0);
  EXPECT_FALSE(fs::exists("starts"));
  StartHistory history("/proc/none", seconds(1000));
  EXPECT_EQ(history.failures(), 0);
  history.failed("x");
  history.ended_well();
}

TEST(RuntimeFolder, IsTheFirstFolderNamedByTheManager) {
  unsetenv("RUNTIME_DIRECTORY");
  EXPECT_TRUE(runtime_folder().empty());
  setenv("RUNTIME_DIRECTORY", "/run/lenticule/lobby:/run/other", 1);
  EXPECT_EQ(runtime_folder(), "/run/lenticule/lobby");
  unsetenv("RUNTIME_DIRECTORY");
  EXPECT_GT(time_since_boot().count(), 0);
}

}  // namespace
}  // namespace lenticule::player
