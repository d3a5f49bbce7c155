// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "farm/work_folder.h"
#include "frames/sequence/sequence_reader.h"
#include "small_farm.h"
#include "tests/support/error_matchers.h"

namespace lenticule::farm {
namespace {

using test::error_of;
using test::LateFiles;
using test::small_plan;
using test::SmallFarm;

TEST(Merge, TheFilmHasTheBytesOfOneRun) {
  for (const uint64_t chunk : {7U, 10U, 32U, 100U}) {
    const SmallFarm farm(small_plan(3, 100, chunk));
    farm.render_all();
    const MergeResult result = merge_film(farm.folder(), farm.film());
    EXPECT_EQ(result.frames, 97U);
    EXPECT_EQ(test::read_bytes(farm.film()), farm.film_of_one_run()) << chunk;
    EXPECT_EQ(result.bytes, std::filesystem::file_size(farm.film()));
  }
}

TEST(Merge, NamesTheMissingChunksAndLeavesTheFilm) {
  const SmallFarm farm(small_plan(0, 60, 10));
  for (const uint64_t chunk : {0U, 1U, 4U}) (void)farm.render(chunk);
  test::write_bytes(farm.film(), {1, 2});
  const Error error = error_of([&] { (void)merge_film(farm.folder(), farm.film()); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_NE(std::string(error.what()).find("3 of 6 chunks are missing: 2-3,5"), std::string::npos)
      << error.what();
  EXPECT_EQ(test::read_bytes(farm.film()), (std::vector<uint8_t>{1, 2}));
}

TEST(Merge, APartialFilmHasTheFramesBeforeTheFirstMissingChunk) {
  const SmallFarm farm(small_plan(0, 60, 10));
  EXPECT_THROW((void)merge_film(farm.folder(), farm.film(), {.partial = true}), Error);
  for (const uint64_t chunk : {0U, 1U, 4U}) (void)farm.render(chunk);
  EXPECT_EQ(merge_film(farm.folder(), farm.film(), {.partial = true}).frames, 20U);
  EXPECT_EQ(frames::SequenceReader(farm.film()).frame_count(), 20U);
}

/// A chunk that was truncated is missing; one with other bytes is found by its digest, and is
/// missing from then on.
TEST(Merge, FindsDamagedChunks) {
  const SmallFarm farm(small_plan(0, 60, 10));
  farm.render_all();
  const auto file = farm.chunk_file(3);
  const std::vector<uint8_t> whole = test::read_bytes(file);
  std::filesystem::resize_file(file, whole.size() - 5);
  EXPECT_NE(std::string(error_of([&] { (void)merge_film(farm.folder(), farm.film()); }).what())
                .find("1 of 6 chunks are missing: 3"),
            std::string::npos);
  std::vector<uint8_t> flipped = whole;
  flipped[flipped.size() / 2] ^= 1;
  test::write_bytes(file, flipped);
  const Error error = error_of([&] { (void)merge_film(farm.folder(), farm.film()); });
  EXPECT_EQ(std::string(error.what()).rfind("chunk 3: ", 0), 0U) << error.what();
  EXPECT_NE(error.hint().find("run lenticule farm render "), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(farm.film()));
  EXPECT_EQ(missing_chunks(farm.folder()), std::vector<uint64_t>{3});
  EXPECT_TRUE(farm.render(3));
  (void)merge_film(farm.folder(), farm.film());
  EXPECT_EQ(test::read_bytes(farm.film()), farm.film_of_one_run());
}

TEST(Merge, RefusesAChunkOfWhichTwoNodesRenderedOtherBytes) {
  const SmallFarm farm(small_plan(0, 60, 10));
  farm.render_all();
  EXPECT_TRUE(farm.render(2, "same"));
  EXPECT_FALSE(farm.render(2, "faulty", true));
  const Error error = error_of([&] { (void)merge_film(farm.folder(), farm.film()); });
  EXPECT_NE(std::string(error.what()).find("chunk 2: node and faulty rendered different bytes"),
            std::string::npos)
      << error.what();
}

TEST(Merge, WaitsForFilesThatTheFolderShowsLate) {
  const SmallFarm farm(small_plan(0, 60, 10));
  farm.render_all();
  const LateFiles late(3);
  const WorkFolder folder(farm.work(), late);
  int pauses = 0;
  MergeOptions options{.wait = std::chrono::seconds(60)};
  options.pause = [&](std::chrono::milliseconds) { ++pauses; };
  (void)merge_film(folder, farm.film(), options);
  EXPECT_GE(pauses, 3);
  EXPECT_EQ(test::read_bytes(farm.film()), farm.film_of_one_run());

  const LateFiles never(1 << 20);
  const WorkFolder empty(farm.work(), never);
  EXPECT_THROW((void)merge_film(empty, farm.film(), options), Error);
}

TEST(Merge, StopsOnRequestWithoutAFilm) {
  const SmallFarm farm(small_plan(0, 60, 10));
  farm.render_all();
  const MergeOptions options{.stops = [](uint64_t chunk) { return chunk == 3; }};
  EXPECT_TRUE(merge_film(farm.folder(), farm.film(), options).stopped);
  EXPECT_FALSE(std::filesystem::exists(farm.film()));
}

TEST(Merge, WritesNumbersAsRanges) {
  EXPECT_EQ(ranges_text({}), "");
  EXPECT_EQ(ranges_text({4}), "4");
  EXPECT_EQ(ranges_text({0, 1, 2, 5, 7, 8}), "0-2,5,7-8");
}

}  // namespace
}  // namespace lenticule::farm
