// SPDX-License-Identifier: Apache-2.0
// Tests views that are woven while playing: the right frames in order in every loop, and plan
// changes without a missing frame.
#include "player/sources/weaving_source.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "frames/decoded_source.h"
#include "frames/image_io.h"
#include "frames/weaving/reweave.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/sources/open_source.h"
#include "tests/support/comes_true.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;
using frames::AcquiredFrame;
using frames::PullStatus;
using frames::WovenFrame;

constexpr frames::QuiltLayout kLayout{.columns = 3, .rows = 2, .views = 0, .aspect = 1.5};

WovenFrame noise_quilt(uint32_t state) {
  WovenFrame quilt({.width = 36, .height = 16});
  for (uint8_t& byte : quilt.bytes()) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(state >> 24);
  }
  return quilt;
}

class WeavingSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    rig_file_ = folder_ / "tiny.toml";
    optics::save_rig(optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/tiny.toml"),
                     rig_file_);
  }

  [[nodiscard]] WeavingSourceOptions options() const {
    return {.rig = std::make_shared<LiveRig>(rig_file_), .pool_frames = 3};
  }
  [[nodiscard]] static std::unique_ptr<frames::ViewInput> still(const WovenFrame& quilt) {
    return std::make_unique<frames::ViewInput>(frames::ViewSet(quilt, kLayout));
  }
  [[nodiscard]] static std::unique_ptr<frames::ViewInput> quilts(
      const std::vector<fs::path>& files) {
    std::vector<std::unique_ptr<frames::FrameSource>> sources;
    sources.push_back(std::make_unique<frames::ImageSequence>(
        files, frames::ImageSequenceOptions{.pool_frames = 3}));
    auto tiles = frames::arrange_quilt(sources[0]->geometry(), kLayout, false, "quilts");
    return std::make_unique<frames::ViewInput>(std::move(sources), std::move(tiles), "quilts");
  }
  [[nodiscard]] WovenFrame expected(const WovenFrame& quilt) const {
    return frames::weave_fast(frames::ViewSet(quilt, kLayout),
                              optics::OpticalModel(optics::load_trimmed_rig(rig_file_)));
  }
  std::vector<fs::path> write_quilts(uint32_t count) const {
    std::vector<fs::path> files;
    for (uint32_t n = 0; n < count; ++n) {
      files.push_back(folder_ / ("q_qs3x2a1.5_0" + std::to_string(n) + ".png"));
      frames::write_woven(noise_quilt(n).view(), files.back());
    }
    return files;
  }

  test::ScratchFolder scratch_;
  fs::path folder_ = scratch_.path();
  fs::path rig_file_;
};

/// Pulls with a limit: a source that never answers fails the test.
PullStatus pull_soon(WeavingSource& source, AcquiredFrame& out) {
  for (int n = 0; n < 2000; ++n) {
    const PullStatus status = source.pull(out);
    if (status != PullStatus::NotYet) return status;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    source.service();
  }
  return PullStatus::NotYet;
}

WovenFrame copy_of(const AcquiredFrame& acquired) {
  WovenFrame frame(acquired.frame.geometry);
  std::copy(acquired.frame.bytes.begin(), acquired.frame.bytes.end(), frame.bytes().begin());
  return frame;
}

/// Returns the still frame and expects the source to end after it.
WovenFrame look(WeavingSource& source) {
  AcquiredFrame acquired;
  EXPECT_EQ(pull_soon(source, acquired), PullStatus::Ready);
  const WovenFrame frame = copy_of(acquired);
  source.release(acquired.token);
  EXPECT_EQ(source.pull(acquired), PullStatus::End);
  EXPECT_TRUE(source.rewind());
  return frame;
}

TEST_F(WeavingSourceTest, PlaysASequenceInOrderInEveryLoop) {
  WeavingSource source(quilts(write_quilts(5)), options());
  EXPECT_EQ(source.frame_count(), 5U);
  for (int loop = 0; loop < 3; ++loop) {
    for (uint32_t n = 0; n < 5; ++n) {
      AcquiredFrame acquired;
      ASSERT_EQ(pull_soon(source, acquired), PullStatus::Ready);
      EXPECT_EQ(acquired.number, n);
      EXPECT_EQ(copy_of(acquired), expected(noise_quilt(n))) << "loop " << loop << " frame " << n;
      source.release(acquired.token);
    }
    AcquiredFrame none;
    EXPECT_EQ(pull_soon(source, none), PullStatus::End);
    ASSERT_TRUE(source.rewind());
  }
}

/// Its second picture is marked as a repetition of the first, but differs: if that is woven, it is
/// seen.
class MarkedQuilts final : public test::PlainSource {
 public:
  [[nodiscard]] frames::FrameGeometry geometry() const override {
    return pictures_.front().geometry();
  }
  [[nodiscard]] PullStatus pull(AcquiredFrame& out) override {
    if (next_ == pictures_.size()) return PullStatus::End;
    out = {.frame = pictures_[next_].view(), .number = next_, .repeats = next_ == 1};
    ++next_;
    return PullStatus::Ready;
  }
  [[nodiscard]] bool rewind() override {
    next_ = 0;
    return true;
  }

 private:
  std::vector<WovenFrame> pictures_ = {noise_quilt(0), noise_quilt(1), noise_quilt(2)};
  size_t next_ = 0;
};

TEST_F(WeavingSourceTest, APictureThatIsRepeatedIsWovenOnce) {
  std::vector<std::unique_ptr<frames::FrameSource>> sources;
  sources.push_back(std::make_unique<MarkedQuilts>());
  auto tiles = frames::arrange_quilt(sources[0]->geometry(), kLayout, false, "quilts");
  WeavingSource source(
      std::make_unique<frames::ViewInput>(std::move(sources), std::move(tiles), "quilts"),
      options());
  for (int loop = 0; loop < 10; ++loop) {
    for (const uint32_t picture : {0U, 0U, 2U}) {
      AcquiredFrame acquired;
      ASSERT_EQ(pull_soon(source, acquired), PullStatus::Ready);
      EXPECT_EQ(copy_of(acquired), expected(noise_quilt(picture))) << "loop " << loop;
      source.release(acquired.token);
    }
    AcquiredFrame none;
    EXPECT_EQ(pull_soon(source, none), PullStatus::End);
    ASSERT_TRUE(source.rewind());
  }
}

TEST_F(WeavingSourceTest, WithoutLoopingEachRoundNeedsARewind) {
  WeavingSourceOptions once = options();
  once.plays_again = false;
  WeavingSource source(quilts(write_quilts(2)), once);
  for (int round = 0; round < 3; ++round) {
    AcquiredFrame acquired;
    for (uint32_t n = 0; n < 2; ++n) {
      ASSERT_EQ(pull_soon(source, acquired), PullStatus::Ready);
      EXPECT_EQ(copy_of(acquired), expected(noise_quilt(n)));
      source.release(acquired.token);
    }
    EXPECT_EQ(pull_soon(source, acquired), PullStatus::End);
    EXPECT_TRUE(test::comes_true([&] { return source.saturated(); }));
    EXPECT_EQ(source.ready_count(), 0U);
    ASSERT_TRUE(source.rewind());
  }
}

TEST_F(WeavingSourceTest, CompensatesCrosstalkOnRequest) {
  const WovenFrame quilt = noise_quilt(7);
  WeavingSourceOptions undone = options();
  undone.weaving.crosstalk = "12";
  WeavingSource source(still(quilt), undone);
  const frames::ViewSet views(quilt, kLayout);
  EXPECT_EQ(look(source),
            frames::weave_fast(frames::compensate(views, frames::crosstalk_of_percent(12.0)),
                               optics::OpticalModel(optics::load_trimmed_rig(rig_file_))));
}

TEST_F(WeavingSourceTest, WeavesAStillAgainWhenItsTrimChanges) {
  const WovenFrame quilt = noise_quilt(7);
  WeavingSource source(still(quilt), options());
  const WovenFrame before = expected(quilt);
  EXPECT_EQ(look(source), before);

  AcquiredFrame held;
  ASSERT_EQ(source.pull(held), PullStatus::Ready);
  ASSERT_EQ(source.pull(held), PullStatus::End);
  ASSERT_TRUE(source.rewind());
  optics::save_trim({Lenses(0.3), 0.0}, rig_file_);
  const WovenFrame after = expected(quilt);
  ASSERT_NE(after, before);
  EXPECT_TRUE(test::comes_true([&] { return look(source) == after; }));
  EXPECT_EQ(copy_of(held), before) << "a lent frame stays as it was";
  source.release(held.token);
}

TEST_F(WeavingSourceTest, KeepsTheOldRigWhenTheNewOneIsBroken) {
  const WovenFrame quilt = noise_quilt(7);
  WeavingSource source(still(quilt), options());
  const WovenFrame before = expected(quilt);
  std::ofstream(rig_file_) << "this is no rig";
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(look(source), before);
  EXPECT_EQ(source.plans(), 1U);
}

TEST_F(WeavingSourceTest, LosesNoFrameWhileATrimChanges) {
  WeavingSource source(quilts(write_quilts(5)), options());
  const WovenFrame before = expected(noise_quilt(0));
  uint64_t shown = 0;
  bool changed = false;
  for (int n = 0; n < 4000 && !(changed && shown % 5 == 0); ++n) {
    AcquiredFrame acquired;
    const PullStatus status = pull_soon(source, acquired);
    if (status == PullStatus::End) {
      ASSERT_TRUE(source.rewind());
      continue;
    }
    ASSERT_EQ(status, PullStatus::Ready);
    ASSERT_EQ(acquired.number, shown++ % 5);
    if (acquired.number == 0 && copy_of(acquired) != before) {
      EXPECT_EQ(copy_of(acquired), expected(noise_quilt(0))) << "neither the old nor the new rig's";
      changed = true;
    }
    source.release(acquired.token);
    if (shown == 3) optics::save_trim({Lenses(0.3), 0.0}, rig_file_);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(changed);
}

TEST_F(WeavingSourceTest, ABrokenQuiltFailsWhenItsTurnComes) {
  const std::vector<fs::path> files = write_quilts(4);
  std::ofstream(files[2]) << "no picture";
  WeavingSource source(quilts(files), options());
  AcquiredFrame acquired;
  for (int n = 0; n < 2; ++n) {
    ASSERT_EQ(pull_soon(source, acquired), PullStatus::Ready);
    source.release(acquired.token);
  }
  EXPECT_EQ(pull_soon(source, acquired), PullStatus::Failed);
  EXPECT_NE(source.failure().find("_02.png"), std::string::npos) << source.failure();
}

TEST_F(WeavingSourceTest, IsOpenedForAQuiltsName) {
  const std::vector<fs::path> files = write_quilts(2);
  const optics::Rig rig = optics::load_rig(rig_file_);
  const auto opened = open_source(parse_source(files[1].string()),
                                  {.panel = {rig.panel.width_px, rig.panel.height_px},
                                   .rig = std::make_shared<LiveRig>(rig_file_)});
  AcquiredFrame acquired;
  ASSERT_EQ(opened.source->pull(acquired), PullStatus::Ready);
  EXPECT_EQ(copy_of(acquired), expected(noise_quilt(1)));
  opened.source->release(acquired.token);
  EXPECT_FALSE(opened.woven_elsewhere);
}

}  // namespace
}  // namespace lenticule::player
