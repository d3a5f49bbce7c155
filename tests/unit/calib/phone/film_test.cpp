// SPDX-License-Identifier: Apache-2.0
// A film of a phone that is moved past the chart, from the simulator of lenticule-bench, which
// shares no code with the fit.
#include "calib/phone/film.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lab/phone/sweep_trial.h"

namespace lenticule::calib {
namespace {

using lab::HandOutcome;
using lab::HandResult;
using lab::SweepTrial;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// All tests share one simulated film.
class Film : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    lab::WorkshopLimits limits = lab::limits_for(1280, 1600);
    limits.shots = 8;
    trial_ = std::make_unique<SweepTrial>(kSeed, limits);
  }
  static void TearDownTestSuite() { trial_.reset(); }

  static FilmChoice choice_after(const std::function<void(std::vector<FilmFrame>&)>& change) {
    std::vector<FilmFrame> frames = trial_->frames();
    change(frames);
    return choose_frames(frames, trial_->chart());
  }
  static std::string refusal_after(const std::function<void(FilmFrame&)>& change) {
    return choice_after([&](std::vector<FilmFrame>& frames) {
             for (FilmFrame& frame : frames) change(frame);
           })
        .refusal;
  }

  static constexpr uint64_t kSeed = 20001;
  static inline std::unique_ptr<SweepTrial> trial_;
};

// The phone moves by 100 mm a second: by 2 mm from the first row read to the last.
TEST_F(Film, TheMotionOfTheFramesIsKnownToTheFit) {
  const HandResult found = trial_->calibrate();
  EXPECT_EQ(found.outcome, HandOutcome::Right)
      << found.error_lenses << ::testing::PrintToString(found.reasons);
  std::vector<PhonePhoto> still = trial_->chosen();
  for (PhonePhoto& frame : still) frame.findings.motion.reset();
  const HandResult ignored = trial_->calibrate(still);
  EXPECT_TRUE(!ignored.fitted || ignored.error_lenses > 1.5 * found.error_lenses)
      << ignored.error_lenses << " and " << found.error_lenses;
}

TEST_F(Film, AStabilisedFilmIsRefused) {
  std::vector<PhonePhoto> frames = trial_->chosen();
  for (size_t n = 0; n < frames.size(); ++n) {
    PhotoFindings& found = frames[n].findings;
    const double turn = 2.0 * static_cast<double>(n);
    const Vec2 shift = Vec2{std::cos(turn), std::sin(turn)} * (0.01 * found.width);
    for (TagSighting& tag : found.tags)
      for (Vec2& corner : tag.corners_px) corner = corner + shift;
    for (FringeBlock& block : found.blocks) block.pixel = block.pixel + shift;
    found.pose->middle_px = found.pose->middle_px + shift;
  }
  const HandResult result = trial_->calibrate(frames);
  EXPECT_EQ(result.outcome, HandOutcome::Refused);
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("switch video stabilisation off")));
}

TEST_F(Film, ChosenFramesAreSharpAndFarApart) {
  const FilmChoice all = choice_after([](auto&) {});
  EXPECT_EQ(all.refusal, "");
  ASSERT_GE(all.frames.size(), 6U);
  const size_t blurred = all.frames[2].frame;
  const FilmChoice rest = choice_after([&](std::vector<FilmFrame>& frames) {
    for (TagSighting& tag : frames[blurred].found.tags) tag.blur_px *= 3.0;
  });
  EXPECT_EQ(rest.sharp, all.sharp - 1);
  for (const FilmChoice::Chosen& one : rest.frames) EXPECT_NE(one.frame, blurred);
  // Many more frames from the first place do not displace those of others.
  const FilmChoice slow = choice_after([&](std::vector<FilmFrame>& frames) {
    const std::vector<FilmFrame> first(frames.begin(), frames.begin() + 3);
    for (int again = 0; again < 20; ++again) {
      frames.insert(frames.begin(), first.begin(), first.end());
      for (size_t n = 0; n < 3; ++n) frames[n].seconds -= 0.3 * (again + 1);
    }
  });
  EXPECT_EQ(slow.sharp, all.sharp + 20);
  ASSERT_EQ(slow.frames.size(), kMostFilmFrames);
  EXPECT_EQ(slow.frames.back().frame, all.frames.back().frame + 60);
}

TEST_F(Film, EachFaultHasItsOwnRefusal) {
  EXPECT_THAT(refusal_after([](FilmFrame& frame) { frame.seconds *= 0.1; }),
              HasSubstr("the film is too short"));
  EXPECT_THAT(refusal_after([](FilmFrame& frame) { frame.seconds *= 20.0; }),
              HasSubstr("longer than 60 s"));
  EXPECT_THAT(refusal_after([](FilmFrame& frame) {
                frame.found.tags.resize(1);
                frame.found.refusal = "only 1 of 9 tags were found: the panel is cut";
              }),
              HasSubstr("none of 24 frames shows the whole chart of this rig: only 1 of 9 tags"));
  EXPECT_THAT(refusal_after([](FilmFrame& frame) {
                frame.found.tags.resize(1);
                frame.found.tags[0].id = 0;
                frame.found.tags[0].corners_px[0].x = std::fmod(frame.seconds * 2500.0, 1e5);
                frame.found.refusal = "only 1 of 9 tags were found";
              }),
              HasSubstr("moves too fast"));
  const FilmFrame middle = trial_->frames()[13];
  const FilmChoice standing = choice_after([&](std::vector<FilmFrame>& frames) {
    for (FilmFrame& frame : frames) frame.found = middle.found;
  });
  EXPECT_THAT(standing.refusal, HasSubstr("from nearly one place"));
  EXPECT_THAT(standing.frames, IsEmpty());
  EXPECT_THAT(choose_frames({}, trial_->chart()).refusal, HasSubstr("too short"));
}

}  // namespace
}  // namespace lenticule::calib
