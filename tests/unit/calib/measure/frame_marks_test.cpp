// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/frame_marks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace lenticule::calib {
namespace {

using Cells = std::array<double, MarkCells::kMost>;

/// A camera that sees the middle of the panel: cells of 12 x 10 pixels in a row.
class MarkStage {
 public:
  GreyPicture picture(double panel, Cells cells, double gain = 1.0, Vec2 moved = {}) {
    GreyPicture out{.width = 100, .height = 40, .light = {}, .clipped = {}};
    out.clipped.assign(4000, 0);
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 100; ++x) {
        double light = 0.6 * panel;
        // The part of the camera pixel within the rows of the cells.
        const double top = 15.0 + moved.y, left = 8.0 + moved.x;
        const double in_row =
            std::clamp(y + 1.0 - top, 0.0, 1.0) * std::clamp(top + 10.0 - y, 0.0, 1.0);
        constexpr double kBorder = 3.0;
        if (y + 1.0 > top - kBorder && y < top + 10.0 + kBorder && x + 1.0 > left - kBorder &&
            x < left + 84.0 + kBorder)
          light = 0.0;
        for (size_t cell = 0; cell < cells.size(); ++cell) {
          const double begin = left + 12.0 * static_cast<double>(cell);
          const double part =
              std::clamp(x + 1.0 - begin, 0.0, 1.0) * std::clamp(begin + 12.0 - x, 0.0, 1.0);
          light += 0.6 * cells[cell] * part * in_row;
        }
        light = gain * (light + 0.02) + noise * noise_(random_);
        out.light.push_back(static_cast<float>(light));
      }
    return out;
  }
  GreyPicture marked(double panel, int mark, double gain = 1.0, int code = 0, Vec2 moved = {}) {
    Cells cells{};
    for (int cell = 0; cell < MarkCells::kMost; ++cell)
      cells[static_cast<size_t>(cell)] = MarkCells::lit(cell, mark, code) ? 1.0 : 0.0;
    return picture(panel, cells, gain, moved);
  }
  std::optional<MarkReader> reader() {
    return MarkReader::find({marked(0, 0), marked(0, 1), marked(0, 2)}, marked(1, 3));
  }
  std::optional<MarkReader> code_reader() {
    const auto dark = [&](int k) {
      return marked(0, k, 1.0, kFindingCodes[static_cast<size_t>(k)]);
    };
    return MarkReader::find({dark(0), dark(1), dark(2)}, marked(1, 3));
  }

  double noise = 0.01;

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

TEST(MarkReader, ABlendOfTwoPicturesIsUnsettled) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.reader();
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->read(stage.picture(0.5, {1.0, 0.5, 0.0, 0.5})).state, MarkState::Unsettled);
  EXPECT_EQ(reader->read(stage.picture(0.5, {1.0, 1.0, 0.0, 0.0})).state, MarkState::Unsettled)
      << "the parity is wrong";
}

TEST(MarkReader, DetectsAnObstructedPanel) {
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

TEST(MarkReader, ReadsEveryCodeOnAnyPatternEvenIfDim) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.code_reader();
  ASSERT_TRUE(reader);
  for (const double panel : {0.0, 0.5, 1.0})
    for (int code = 0; code < 1 << kCodeBits; ++code)
      for (const double gain : {0.4, 1.0, 1.3}) {
        const MarkReading reading = reader->read(stage.marked(panel, 2, gain, code));
        EXPECT_EQ(reading.state, MarkState::Read);
        EXPECT_EQ(reading.code, code);
      }
}

TEST(MarkReader, ReadsNoCodeFromMarksWithoutOne) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.reader();
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->read(stage.marked(0.5, 1)).code, kNoCode);
}

TEST(MarkReader, AnAmbiguousBitGivesNoCode) {
  MarkStage stage;
  const std::optional<MarkReader> reader = stage.code_reader();
  ASSERT_TRUE(reader);
  const MarkReading reading = reader->read(stage.picture(0.5, {1, 0, 0, 0, 1, 0.5, 0}));
  EXPECT_EQ(reading.state, MarkState::Read);
  EXPECT_EQ(reading.code, kNoCode);
}

TEST(MarkReader, MeasuresTheMovementOfTheMarks) {
  MarkStage stage;
  stage.noise = 0.005;
  const std::optional<MarkReader> reader = stage.code_reader();
  ASSERT_TRUE(reader);
  for (const Vec2 moved : {Vec2{0.0, 0.0}, Vec2{0.3, -0.2}, Vec2{-0.4, 0.1}})
    for (const double panel : {0.0, 0.5, 1.0})
      for (int mark = 0; mark < kMarkCounts; ++mark)
        for (const double gain : {0.7, 1.0}) {
          const Vec2 found = reader->moved(stage.marked(panel, mark, gain, 5, moved));
          EXPECT_NEAR(found.x, moved.x, 0.08);
          EXPECT_NEAR(found.y, moved.y, 0.08);
        }
}

}  // namespace
}  // namespace lenticule::calib
