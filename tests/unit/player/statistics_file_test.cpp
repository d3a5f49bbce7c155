// SPDX-License-Identifier: Apache-2.0
// Tests the file of --stats on disks that are full, removed, or come back.
#include "player/session/statistics_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/comes_true.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

class StatisticsFileTest : public testing::Test {
 protected:
  [[nodiscard]] std::string text() const { return test::read_text(folder_ / "stats.json"); }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path();
};

TEST_F(StatisticsFileTest, WritesAgainWhenARemovedFolderReturns) {
  StatisticsFile file(folder_ / "stats.json");
  fs::remove_all(folder_);
  file.write("a");
  ASSERT_TRUE(test::comes_true([&] { return file.state().failures == 1; }));
  EXPECT_NE(file.state().reason.find("stats.json"), std::string::npos) << file.state().reason;
  fs::create_directories(folder_);
  file.write("b");
  ASSERT_TRUE(test::comes_true([&] { return file.state().reason.empty(); }));
  EXPECT_EQ(text(), "b");
}

TEST_F(StatisticsFileTest, ReportsAMissingFileAtTheEnd) {
  StatisticsFile file(folder_ / "stats.json");
  fs::remove_all(folder_);
  file.write("a");
  EXPECT_NE(file.finish(seconds(60)).find("stats.json: cannot write"), std::string::npos);
}

TEST_F(StatisticsFileTest, RefusesUnwritableNames) {
  EXPECT_THROW(StatisticsFile(folder_ / "none" / "stats.json"), Error);
  EXPECT_THROW(StatisticsFile{folder_}, Error);
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(StatisticsFile(folder_ / "pipe"), Error);
  std::ofstream(folder_ / "file") << "x";
  EXPECT_THROW(StatisticsFile(folder_ / "file" / "stats.json"), Error);
}

TEST(RetriedWritesTest, PausesGrowToHalfAMinuteAndEndWithASuccess) {
  RetriedWrites writes;
  RetriedWrites::Clock::time_point now{};
  EXPECT_TRUE(writes.due(now));
  for (const int pause : {1, 2, 4, 8, 16, 30, 30}) {
    writes.failed("full", now);
    EXPECT_FALSE(writes.due(now + seconds(pause) - milliseconds(1))) << pause;
    now += seconds(pause);
    EXPECT_TRUE(writes.due(now)) << pause;
  }
  EXPECT_EQ(writes.state().failures, 7u);
  writes.succeeded();
  EXPECT_EQ(writes.state().reason, "");
  writes.failed("full", now);
  EXPECT_TRUE(writes.due(now + seconds(1)));
  EXPECT_FALSE(writes.due(now));
  writes.try_at_once();
  EXPECT_TRUE(writes.due(now));
}

}  // namespace
}  // namespace lenticule::player
