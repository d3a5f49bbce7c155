// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/frame_marks.h"

#include <gtest/gtest.h>

#include <random>

namespace lenticule::calib {
namespace {

/// A camera that sees the middle of the panel: cells of 12 x 10 pixels in a row.
class MarkStage {
 public:
  GreyPicture picture(double panel, std::array<double, 4> cells, double gain = 1.0) {
    GreyPicture out{.width = 100, .height = 40, .light = {}, .clipped = {}};
    out.clipped.assign(4000, 0);
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 100; ++x) {
        double light = 0.6 * panel;
        const bool in_row = y >= 15 && y < 25 && x >= 26 && x < 74;
        if (in_row) light = 0.6 * cells[static_cast<size_t>((x - 26) / 12)];
        light = gain * (light + 0.02) + 0.01 * noise_(random_);
        out.light.push_back(static_cast<float>(light));
      }
    return out;
  }
  GreyPicture marked(double panel, int mark, double gain = 1.0) {
    std::array<double, 4> cells{};
    for (int cell = 0; cell < 4; ++cell)
      cells[static_cast<size_t>(cell)] = MarkCells::lit(cell, mark) ? 1.0 : 0.0;
    return picture(panel, cells, gain);
  }
  std::optional<MarkReader> reader() {
    return MarkReader::find({marked(0, 0), marked(0, 1), marked(0, 2)}, marked(1, 3));
  }

 private:
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_;
};

TEST(MarkReader, ReadsEveryNumberOnAnyPattern) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.reader();
  ASSERT_TRUE(reader);
  for (const double panel : {0.0, 0.5, 1.0})
    for (int mark = 0; mark < kMarkCounts; ++mark)
      for (const double gain : {0.7, 1.0, 1.3}) {
        const MarkReading reading = reader->read(stage.marked(panel, mark, gain));
        EXPECT_EQ(reading.state, MarkState::Read);
        EXPECT_EQ(reading.mark, mark);
      }
}

TEST(MarkReader, HalfWayBetweenTwoPicturesIsUnsettled) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.reader();
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->read(stage.picture(0.5, {1.0, 0.5, 0.0, 0.5})).state, MarkState::Unsettled);
  EXPECT_EQ(reader->read(stage.picture(0.5, {1.0, 1.0, 0.0, 0.0})).state, MarkState::Unsettled)
      << "the parity is wrong";
}

TEST(MarkReader, SomebodyBeforeThePanelIsNoticed) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.reader();
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->read(stage.picture(0.0, {0.0, 0.0, 0.0, 0.0})).state, MarkState::Lost);
  EXPECT_EQ(reader->read(stage.picture(0.5, {1.0, 3.0, 0.0, 3.0})).state, MarkState::Lost);
}

TEST(MarkReader, HiddenCellsAreNotFound) {
  MarkStage stage;
  EXPECT_FALSE(MarkReader::find({stage.picture(0, {1, 0, 0, 0}), stage.picture(0, {1, 1, 0, 0}),
                                 stage.picture(0, {1, 0, 1, 0})},
                                stage.picture(1, {1, 1, 1, 0})))
      << "no parity cell";
}

}  // namespace
}  // namespace lenticule::calib
