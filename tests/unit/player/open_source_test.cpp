// SPDX-License-Identifier: Apache-2.0
#include "player/sources/open_source.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "frames/image_io.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 8};

class SourceOpen : public testing::Test {
 protected:
  test::ScratchFolder scratch;
  fs::path folder = scratch.path();
  void SetUp() override {
    for (uint64_t k = 3; k < 8; ++k)
      frames::write_woven(test::numbered_frame(kSmall, k).view(),
                          folder / fmt::format("{:03}.png", k));
  }

  [[nodiscard]] std::string pattern() const { return (folder / "%03d.png").string(); }

  static ErrorKind failure(const std::string& source, const OpenContext& context,
                           const char* named) {
    const Error error = test::error_of([&] { (void)open_source(parse_source(source), context); });
    EXPECT_THAT(error.what(), testing::HasSubstr(named));
    return error.kind();
  }
};

TEST_F(SourceOpen, BeginsAtALaterFrameAndLoopsFromTheFirst) {
  for (const int slots : {2, 3, 8}) {
    const OpenedSource opened =
        open_source(parse_source(pattern()), {.panel = kSmall, .slots = slots, .first_frame = 3});
    std::vector<uint64_t> numbers;
    frames::AcquiredFrame acquired;
    for (int rounds = 0; rounds < 2;) {
      const frames::PullStatus status = opened.source->pull(acquired);
      ASSERT_NE(status, frames::PullStatus::Failed);
      if (status == frames::PullStatus::End) {
        ++rounds;
        ASSERT_TRUE(opened.source->rewind());
      }
      if (status != frames::PullStatus::Ready) continue;
      numbers.push_back(acquired.number);
      EXPECT_EQ(test::checksum_of(acquired.frame),
                test::checksum_of(test::numbered_frame(kSmall, 3 + acquired.number).view()));
      opened.source->release(acquired.token);
    }
    EXPECT_THAT(numbers, testing::ElementsAre(3, 4, 0, 1, 2, 3, 4)) << slots << " slots";
  }
}

TEST_F(SourceOpen, OpensABlackFrameOfThePanelsSize) {
  const OpenedSource opened = open_source(parse_source("black"), {.panel = {64, 48}});
  frames::AcquiredFrame acquired;
  ASSERT_EQ(opened.source->pull(acquired), frames::PullStatus::Ready);
  EXPECT_EQ(acquired.frame.geometry, (frames::FrameGeometry{64, 48}));
  EXPECT_EQ(std::count(acquired.frame.bytes.begin(), acquired.frame.bytes.end(), 0), 64 * 48 * 3);
  EXPECT_EQ(failure("black", {.panel = kSmall, .frames = FrameRange{0, 1}}, "--frames"),
            ErrorKind::Usage);
}

TEST_F(SourceOpen, OpensATestCardOfThePanelsSizeThatNeverEnds) {
  const OpenedSource opened = open_source(
      parse_source("card"), {.panel = {64, 48}, .card = {.headline = "HI", .rows = {}}});
  frames::FrameSource& source = *opened.source;
  const frames::WovenFrame expected =
      display::draw_test_card({64, 48}, {.headline = "HI", .rows = {}});
  for (int loop = 0; loop < 3; ++loop) {
    frames::AcquiredFrame acquired;
    ASSERT_EQ(source.pull(acquired), frames::PullStatus::Ready);
    EXPECT_TRUE(std::equal(acquired.frame.bytes.begin(), acquired.frame.bytes.end(),
                           expected.bytes().begin(), expected.bytes().end()));
    EXPECT_EQ(source.pull(acquired), frames::PullStatus::End);
    EXPECT_TRUE(source.rewind());
    EXPECT_FALSE(source.rewind()) << "at the start";
  }
  EXPECT_EQ(failure("card", {.panel = kSmall, .frames = FrameRange{0, 1}}, "--frames"),
            ErrorKind::Usage);
}

TEST_F(SourceOpen, NamesTheFirstMissingFrameOfARange) {
  EXPECT_EQ(failure(pattern(), {.panel = kSmall, .frames = FrameRange{4, 10}}, "008.png"),
            ErrorKind::Input);
  EXPECT_EQ(failure(pattern(), {.panel = kSmall, .frames = FrameRange{0, 10}}, "000.png"),
            ErrorKind::Input);
  const FrameRange endless{4, ~uint64_t{0}};
  EXPECT_EQ(failure(pattern(), {.panel = kSmall, .frames = endless}, "008.png"), ErrorKind::Input);
}

TEST_F(SourceOpen, RefusesUnplayableSources) {
  for (const std::string& text :
       {std::string(), folder.string(), std::string("ring:"), std::string("list.m3u")})
    EXPECT_EQ(failure(text, {.panel = kSmall}, ""), ErrorKind::Usage) << text;
  EXPECT_EQ(failure((folder / "none.png").string(), {.panel = kSmall}, "none.png"),
            ErrorKind::Input);
  EXPECT_EQ(failure((folder / "005.png").string(), {.panel = kSmall, .frames = FrameRange{0, 1}},
                    "005.png"),
            ErrorKind::Usage);
}

TEST_F(SourceOpen, OpensARingAndPrintsHowToConnect) {
  const std::string socket = (folder / "ring.sock").string();
  const OpenedSource opened = open_source(parse_source("ring:" + socket), {.panel = kSmall});
  EXPECT_EQ(opened.source->geometry(), kSmall);
  EXPECT_TRUE(fs::is_socket(socket));
  EXPECT_THAT(opened.stall_hint, testing::HasSubstr("ring:" + socket));
}

}  // namespace
}  // namespace lenticule::player
