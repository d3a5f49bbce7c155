// SPDX-License-Identifier: Apache-2.0
// Tests the order of photographs: doubles, missing ones, and others. The photographs are the
// patterns themselves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "calib/measure/viewpoint.h"
#include "frames/srgb.h"
#include "lab/panel/trial.h"
#include "tests/support/error_matchers.h"

namespace lenticule::calib {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Returns the patterns as pictures, which are drawn once for all tests.
const std::vector<CameraPicture>& pictures_of(const std::vector<Pattern>& patterns,
                                              const optics::Panel& panel) {
  static const std::vector<CameraPicture> kPictures = [&] {
    std::vector<CameraPicture> out;
    frames::WovenFrame frame;
    for (const Pattern& pattern : patterns) {
      draw_pattern(pattern, panel, frame);
      std::vector<float> light(frame.bytes().size());
      std::ranges::transform(frame.bytes(), light.begin(), [](uint8_t code) {
        return static_cast<float>(frames::linear_of_codes()[code]);
      });
      out.push_back({.width = panel.width_px,
                     .height = panel.height_px,
                     .channels = 3,
                     .light = std::move(light)});
    }
    return out;
  }();
  return kPictures;
}

/// PatternPictures is a camera whose pictures are the patterns with the given numbers, in order.
class PatternPictures final : public Camera {
 public:
  PatternPictures(const std::vector<CameraPicture>& pictures, std::vector<size_t> order)
      : pictures_(pictures), order_(std::move(order)) {}
  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds, Nanoseconds) override {
    if (next_ == order_.size()) return GrabStatus::Gone;
    out = pictures_[order_[next_]];
    out.sequence = next_++;
    return GrabStatus::Ready;
  }
  [[nodiscard]] Nanoseconds now() const override { return Nanoseconds(0); }
  [[nodiscard]] std::vector<std::string> drifted_controls() override { return {}; }
  [[nodiscard]] std::string failure() const override { return "there are no more photographs"; }

 private:
  const std::vector<CameraPicture>& pictures_;
  std::vector<size_t> order_;
  size_t next_ = 0;
  CameraFacts facts_;
};

class PhotoOrder : public testing::Test {
 protected:
  PhotoOrder() { std::iota(order_.begin(), order_.end(), size_t{0}); }

  /// Captures all patterns and returns the numbers of the photographs that were not used.
  [[nodiscard]] std::vector<uint64_t> doubles() const {
    frames::NullSink sink(rig_.panel.width_px, rig_.panel.height_px);
    PatternPictures camera(pictures_of(patterns_, rig_.panel), order_);
    PatternCapture capture(sink, camera, rig_.panel,
                           {.average = 1,
                            .most_dropped = 0,
                            .clocked = false,
                            .place = "centre",
                            .patterns = static_cast<int>(patterns_.size())},
                           {});
    capture.show_code(RigCode(optics::fingerprint(rig_)));
    std::vector<GreyPicture> first;
    const std::span<const Pattern> all(patterns_);
    capture.capture(all.first(4), [&](const Pattern&, const CameraPicture& picture) {
      first.push_back(grey_of(picture));
    });
    capture.check_marks(MarkReader::find({first[0], first[1], first[2]}, first[3]).value());
    capture.capture(all.subspan(4), [](const Pattern&, const CameraPicture&) {});
    return capture.doubles();
  }
  void expect_failure(ErrorKind kind, const char* what) const {
    const Error error = test::error_of([&] { (void)doubles(); });
    EXPECT_EQ(error.kind(), kind);
    EXPECT_THAT(error.what(), HasSubstr(what));
  }
  void leave_out(size_t first, size_t count) {
    const auto at = order_.begin() + static_cast<ptrdiff_t>(first);
    order_.erase(at, at + static_cast<ptrdiff_t>(count));
  }

  optics::Rig rig_ = lab::plain_trial(320, 180, 320, 180).start;
  std::vector<Pattern> patterns_ = photo_patterns(rig_);
  std::vector<size_t> order_ = std::vector<size_t>(patterns_.size());
};

TEST_F(PhotoOrder, UsesDoublesOnceAndNamesThem) {
  EXPECT_THAT(doubles(), ElementsAre());
  order_.insert(order_.begin() + 30, 29);
  order_.insert(order_.begin() + 8, 7);
  EXPECT_THAT(doubles(), ElementsAre(8U, 31U));
}

TEST_F(PhotoOrder, NamesAMissingPhotograph) {
  leave_out(16, 1);
  expect_failure(ErrorKind::Input, "centre: the photograph of pattern 17 of 75 is missing");
}

TEST_F(PhotoOrder, NamesTwoMissingPhotographs) {
  leave_out(16, 2);
  expect_failure(ErrorKind::Input, "the photographs of patterns 17 to 18 of 75 are missing");
}

TEST_F(PhotoOrder, NamesAMissingLastPhotograph) {
  leave_out(74, 1);
  expect_failure(ErrorKind::Input, "pattern 75 of 75 is missing");
}

TEST_F(PhotoOrder, RefusesPhotographsInAnotherOrder) {
  std::swap(order_[16], order_[41]);
  expect_failure(ErrorKind::Quality, "photograph 17 shows the marks of another pattern");
}

}  // namespace
}  // namespace lenticule::calib
