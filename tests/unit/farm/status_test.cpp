// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include "base/file.h"
#include "farm/work_folder.h"
#include "small_farm.h"

namespace lenticule::farm {
namespace {

using test::small_plan;
using test::SmallFarm;

/// Writes the progress of a process that renders `chunk`.
void start_attempt(const SmallFarm& farm, uint64_t chunk, const std::string& node,
                   const std::string& name, double seconds = 10.0) {
  const auto folder = farm.folder().attempts_folder(chunk) / name;
  std::filesystem::create_directories(folder);
  const ChunkProgress progress{
      .node = node, .chunk = chunk, .done = 4, .count = 10, .seconds = seconds};
  write_text_file(folder / "progress.json", record_to_json(progress));
}

void fail(const SmallFarm& farm, uint64_t chunk) {
  write_text_file(
      farm.folder().failure_file(chunk),
      record_to_json(ChunkFailure{.node = "n2", .chunk = chunk, .error = "disk full", .hint = ""}));
}

TEST(FarmStatus, CountsEveryChunkOnce) {
  const SmallFarm farm(small_plan(0, 95, 10));
  (void)farm.render(0, "n1");
  (void)farm.render(9, "n2");
  start_attempt(farm, 2, "n1", "a");
  start_attempt(farm, 9, "n1", "a");  // an orphan: the chunk is done
  fail(farm, 3);
  fail(farm, 2);  // an earlier failure of a chunk that runs again
  fail(farm, 0);
  const FarmStatus status = read_status(farm.folder(), folder_time(farm.work()));
  EXPECT_EQ(status.chunks, 10U);
  EXPECT_EQ(status.chunks_done, 2U);
  EXPECT_EQ(status.frames_done, 15U);
  ASSERT_EQ(status.running.size(), 1U);
  EXPECT_EQ(status.running[0].progress.chunk, 2U);
  ASSERT_EQ(status.failed.size(), 1U);
  EXPECT_EQ(status.failed[0].chunk, 3U);
  EXPECT_EQ(ranges_text(status.missing), "1,4-8");
  EXPECT_FALSE(status.complete());
  ASSERT_EQ(status.nodes.size(), 2U);
  EXPECT_EQ(status.nodes[0].node, "n1");
  EXPECT_EQ(status.nodes[0].frames, 10U);
  EXPECT_EQ(status.nodes[0].running, 1U);
}

TEST(FarmStatus, AProcessThatIsSilentForLongIsNotRunning) {
  const SmallFarm farm(small_plan(0, 95, 10));
  start_attempt(farm, 2, "n1", "a");
  const double now = folder_time(farm.work());
  EXPECT_EQ(read_status(farm.folder(), now).running.size(), 1U);
  const FarmStatus later = read_status(farm.folder(), now + kSilentSeconds + 5.0);
  EXPECT_EQ(later.running.size(), 0U);
  EXPECT_EQ(later.missing.size(), 10U);
}

TEST(FarmStatus, TheRateComesFromTheFileSystemsClock) {
  const SmallFarm farm(small_plan(0, 100, 10));
  for (uint64_t chunk = 0; chunk < 5; ++chunk) (void)farm.render(chunk, "n", false, 20.0);
  const double now = folder_time(farm.work());
  // Five chunks of ten frames ended now, each after 20 s of work.
  const FarmStatus status = read_status(farm.folder(), now);
  EXPECT_NEAR(status.frames_per_second, 50.0 / 20.0, 0.5);
  ASSERT_TRUE(status.seconds_left);
  EXPECT_NEAR(*status.seconds_left, 20.0, 4.0);
  // An hour later, nothing was finished within ten minutes.
  const FarmStatus later = read_status(farm.folder(), now + 3600.0);
  EXPECT_EQ(later.frames_per_second, 0.0);
  EXPECT_FALSE(later.seconds_left);
}

TEST(FarmStatus, FramesOfChunksInProgressCountInTheRate) {
  const SmallFarm farm(small_plan(0, 100, 10));
  for (const uint64_t chunk : {3U, 5U}) start_attempt(farm, chunk, "n", "a", 1800.0);
  const FarmStatus status = read_status(farm.folder(), folder_time(farm.work()));
  EXPECT_NEAR(status.frames_per_second, 8.0 / 1800.0, 1e-4);
  ASSERT_TRUE(status.seconds_left);
  EXPECT_NEAR(*status.seconds_left, (100.0 - 8.0) * 1800.0 / 8.0, 300.0);
  EXPECT_EQ(status.frames_done, 0U) << "only whole chunks are done";
}

TEST(FarmStatus, ShowsTheSlowestChunksAndThoseThatDiffer) {
  const SmallFarm farm(small_plan(0, 100, 10));
  for (uint64_t chunk = 0; chunk < 10; ++chunk)
    (void)farm.render(chunk, "n", false, chunk == 6 ? 90.0 : 1.0 + static_cast<double>(chunk));
  (void)farm.render(4, "faulty", true);
  const FarmStatus status = read_status(farm.folder(), folder_time(farm.work()));
  EXPECT_TRUE(status.complete());
  EXPECT_EQ(status.slowest.front().chunk, 6U);
  EXPECT_EQ(status.slowest.size(), 5U);
  EXPECT_EQ(status.differing, std::vector<uint64_t>{4});
  const std::string text = status_text(status);
  EXPECT_NE(text.find("100 of 100 frames (100.0 %), 10 of 10 chunks"), std::string::npos) << text;
  EXPECT_NE(text.find("ready to merge"), std::string::npos) << text;
  EXPECT_NE(text.find("different bytes by two nodes: chunks 4"), std::string::npos) << text;
  EXPECT_EQ(status_json(status).at("slowest").at(0).at("chunk"), 6);
}

TEST(FarmStatus, NamesOfNodesAreEscaped) {
  const SmallFarm farm(small_plan(0, 10, 10));
  (void)farm.render(0, "\x1b[2J");
  EXPECT_EQ(status_text(read_status(farm.folder(), folder_time(farm.work()))).find('\x1b'),
            std::string::npos);
}

}  // namespace
}  // namespace lenticule::farm
