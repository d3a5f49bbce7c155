// SPDX-License-Identifier: Apache-2.0
#include "farm/work_folder.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/error.h"
#include "base/file.h"
#include "small_farm.h"
#include "tests/support/error_matchers.h"

namespace lenticule::farm {
namespace {

using test::error_of;
using test::small_plan;
using test::SmallFarm;

ino_t inode_of(const std::filesystem::path& file) {
  struct stat status {};
  EXPECT_EQ(::stat(file.c_str(), &status), 0) << file;
  return status.st_ino;
}

ChunkReport some_report() {
  return {.plan = "p",
          .chunk = 3,
          .begin = 30,
          .end = 40,
          .digest = "00ff",
          .bytes = 1234567890123,
          .first_bands = {1, UINT64_MAX},
          .last_bands = {0, 7},
          .node = "n\"1",
          .isa = "avx2",
          .threads = 8,
          .seconds = 1.5,
          .render_seconds = 1.25,
          .extra_seconds = 0.125,
          .started = 1.7e9};
}

TEST(ChunkReport, IsTheSameAfterWritingAndReading) {
  EXPECT_EQ(parse_record<ChunkReport>(record_to_json(some_report()), "r"), some_report());
}

TEST(ChunkReport, NamesTheKeyThatIsWrong) {
  std::string text = record_to_json(some_report());
  text.replace(text.find("ffffffffffffffff"), 16, "fffffffffffffffg");
  EXPECT_STREQ(error_of([&] { (void)parse_record<ChunkReport>(text, "r"); }).what(),
               "r: first_bands: not digests of 16 digits");
}

TEST(WorkFolder, RefusesThePlanOfAnotherFilmAndAcceptsTheSame) {
  const SmallFarm farm(small_plan(0, 30, 10));
  WorkFolder::create(farm.work(), farm.plan(), "/usr/bin/lenticule");
  Plan other = small_plan(0, 31, 10);
  other.output = farm.plan().output;
  const Error error = error_of([&] { WorkFolder::create(farm.work(), other, "lenticule"); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_NE(std::string(error.what()).find("has the plan of another film"), std::string::npos);
}

TEST(WorkFolder, AFolderWithoutAPlanIsAnInputError) {
  const test::ScratchFolder empty;
  const Error error = error_of([&] { const WorkFolder folder(empty.path()); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_NE(error.hint().find("lenticule farm plan"), std::string::npos);
}

TEST(WorkFolder, AChunkIsDoneOnlyWithItsReportAndItsWholeFile) {
  const SmallFarm farm(small_plan(0, 30, 10));
  EXPECT_FALSE(farm.folder().done(1));
  (void)farm.render(1);
  EXPECT_TRUE(farm.folder().done(1));
  const auto file = farm.chunk_file(1);
  std::filesystem::rename(file, farm.work() / "aside");
  EXPECT_FALSE(farm.folder().done(1));
  std::filesystem::rename(farm.work() / "aside", file);
  EXPECT_TRUE(farm.folder().done(1));
  // A report of another plan, and a report that a full disk has cut.
  const std::string report = read_text_file(farm.folder().report_file(1), 1 << 20);
  std::string other = report;
  other.replace(other.find(farm.folder().identity()), 4, "0000");
  write_text_file(farm.folder().report_file(1), other);
  EXPECT_FALSE(farm.folder().done(1));
  write_text_file(farm.folder().report_file(1), report.substr(0, report.size() / 2));
  EXPECT_FALSE(farm.folder().done(1));
}

TEST(WorkFolder, AChunkThatIsRenderedTwiceStaysAsItIs) {
  const SmallFarm farm(small_plan(0, 30, 10));
  EXPECT_TRUE(farm.render(1, "a"));
  const auto file = farm.chunk_file(1);
  const auto before = inode_of(file);
  EXPECT_TRUE(farm.render(1, "b"));
  EXPECT_EQ(farm.chunk_file(1), file);
  EXPECT_EQ(inode_of(file), before) << "a process may be reading the file";
  EXPECT_EQ(farm.folder().report(1)->node, "a");
  EXPECT_FALSE(farm.folder().differing_report(1));
}

TEST(WorkFolder, PublishedPredictorsAreReadBackUnlessDamaged) {
  const SmallFarm farm(small_plan(0, 80, 10));
  frames::PredictorTable table{.count = 2, .distance = {0, 90, 183}};
  farm.folder().publish_predictors(32, table, farm.work());
  const auto read = farm.folder().predictors(32);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->count, 2);
  EXPECT_EQ(read->distance[2], 183U);
  EXPECT_FALSE(farm.folder().predictors(64));
  const auto file = farm.folder().predictors_file(32);
  std::filesystem::copy_file(file, farm.folder().predictors_file(64));
  EXPECT_FALSE(farm.folder().predictors(64)) << "of another frame";
  std::string text = read_text_file(file, 1 << 20);
  text.replace(text.find("183"), 3, "184");
  write_text_file(file, text);
  EXPECT_FALSE(farm.folder().predictors(32));
}

}  // namespace
}  // namespace lenticule::farm
