// SPDX-License-Identifier: Apache-2.0
// Tests samples that are interpolated from their neighbours instead of traced.
#include "render/methods/adaptive/key_samples.h"

#include <gtest/gtest.h>

#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr int kCode = lookup_kernel::kCodeParts;

class FilledSamples : public ::testing::Test {
 protected:
  FilledSamples()
      : rig_(test::make_rig({.width = 96, .height = 96})),
        model_(rig_),
        planes_(model_, Isa::Baseline),
        grid_(planes_, test::make_tiny_stage(), reach_of(planes_),
              {.row_step = 2, .columns = 2.0, .cache_views = 2}),
        samples_(grid_) {
    for (int row = 0; row < grid_.rows(); ++row)
      for (int column = 0; column < grid_.columns(); ++column) set(row, column, slope(row, column));
  }

  /// Returns a sample of evenly decreasing light; values between samples are whole numbers, too.
  static KeySamples::Sample slope(int row, int column) {
    const auto value = static_cast<uint16_t>(8000 + 16 * row + 8 * column);
    const auto secondary = 0.001F * static_cast<float>(row + column);
    return {.value = {value, static_cast<uint16_t>(value + 1000), value},
            .group = 4,
            .way = 77,
            .light = {.lit = 1, .hidden = 2, .secondary = {secondary, secondary, secondary}}};
  }
  void set(int row, int column, const KeySamples::Sample& sample) {
    samples_.set(row, kCacheView, column, sample);
  }
  [[nodiscard]] int value(int row, int column, int channel) const {
    const auto in_row = static_cast<size_t>(kCacheView * grid_.stride() + column);
    return samples_
        .values()[static_cast<size_t>(3 * row + channel) * samples_.row_samples() + in_row];
  }
  struct Cells {
    std::vector<uint32_t> keys;
    /// Corners in all channels, samples_.row_samples() apart.
    std::vector<lookup_kernel::Corners> corners;
  };
  /// Returns the cells below row kTop.
  [[nodiscard]] Cells find_cells() const {
    Cells cells{std::vector<uint32_t>(static_cast<size_t>(grid_.stride())),
                std::vector<lookup_kernel::Corners>(3 * samples_.row_samples())};
    samples_.find_cells(kTop, kCacheView, tolerances_, cells.keys.data(), cells.corners.data());
    return cells;
  }
  bool fill() { return samples_.fill(kTop, kCacheView, kLeft, tolerances_); }

  static constexpr int kCacheView = 1, kTop = 16, kLeft = 20;
  optics::Rig rig_;
  optics::OpticalModel model_;
  RowPlanes planes_;
  KeyGrid grid_;
  KeySamples samples_;
  Tolerances tolerances_ = Tolerances::for_error(2.0);
};

TEST_F(FilledSamples, InterpolateTheirNeighbours) {
  for (const auto& [row, column] : {std::pair{0, 1}, {1, 0}, {1, 1}})
    set(kTop + row, kLeft + column, {.value = {1, 2, 3}, .group = 8, .way = 5});
  ASSERT_TRUE(fill());
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      for (int channel = 0; channel < 3; ++channel)
        EXPECT_EQ(value(kTop + row, kLeft + column, channel),
                  slope(kTop + row, kLeft + column).value[static_cast<size_t>(channel)]);
  // The samples are equal, so a cell of them has a key.
  const Cells cells = find_cells();
  EXPECT_EQ(cells.keys[kLeft], 4U);
  EXPECT_EQ(cells.keys[kLeft + 1], 4U);
}

TEST_F(FilledSamples, ShowNothingBetweenSamplesOfNothing) {
  // The earlier values of these samples do not matter, nor do their neighbours.
  constexpr int kStep = KeySamples::kCoarse;
  for (const auto& [down, right] : {std::pair{0, 0}, {0, kStep}, {kStep, 0}, {kStep, kStep}})
    samples_.set_nothing(kTop + down, kCacheView, kLeft + right);
  ASSERT_TRUE(fill());
  for (int row = 0; row < kStep; ++row)
    for (int column = 0; column < kStep; ++column)
      EXPECT_TRUE(samples_.shows_nothing(kTop + row, kCacheView, kLeft + column));
  for (int column = 0; column < kStep; ++column)
    EXPECT_EQ(find_cells().keys[static_cast<size_t>(kLeft + column)], 0U);
  set(kTop, kLeft, slope(kTop, kLeft));
  EXPECT_FALSE(fill());
}

/// One corner that shows another surface is replaced by what continues the other three.
TEST_F(FilledSamples, MakeCellsOfThreeCorners) {
  for (const auto& [down, right] : {std::pair{0, 0}, {0, 1}, {1, 0}, {1, 1}}) {
    SCOPED_TRACE(::testing::Message() << down << ", " << right);
    KeySamples::Sample other = slope(kTop + down, kLeft + right);
    other.value = {60000, 0, 7};
    other.group = 8;
    set(kTop + down, kLeft + right, other);
    const Cells cells = find_cells();
    EXPECT_EQ(cells.keys[kLeft], 4U);
    for (size_t c = 0; c < 3; ++c) {
      const lookup_kernel::Corners& corners = cells.corners[c * samples_.row_samples() + kLeft];
      for (int column = 0; column < 2; ++column) {
        EXPECT_EQ(corners.above[column], slope(kTop, kLeft + column).value[c]);
        EXPECT_EQ(corners.below[column], slope(kTop + 1, kLeft + column).value[c]);
      }
    }
    set(kTop + down, kLeft + right, slope(kTop + down, kLeft + right));
  }
}

TEST_F(FilledSamples, MakeNoCellWhereThreeCornersDisagree) {
  KeySamples::Sample other = slope(kTop, kLeft);
  other.group = 8;
  set(kTop, kLeft, other);
  ASSERT_EQ(find_cells().keys[kLeft], 4U);
  const auto key_with = [&](const KeySamples::Sample& corner) {
    set(kTop + 1, kLeft, corner);
    const uint32_t key = find_cells().keys[kLeft];
    set(kTop + 1, kLeft, slope(kTop + 1, kLeft));
    return key;
  };
  KeySamples::Sample corner = slope(kTop + 1, kLeft);
  corner.way = 78;
  EXPECT_EQ(key_with(corner), 0U) << "another path";
  corner = slope(kTop + 1, kLeft);
  corner.value[1] = static_cast<uint16_t>(corner.value[1] + 25 * kCode);
  EXPECT_EQ(key_with(corner), 0U) << "another colour";
  EXPECT_EQ(key_with(other), 0U) << "two corners of another surface";
}

TEST_F(FilledSamples, AreTracedWhereCornersDiffer) {
  const auto fails_with = [&](const KeySamples::Sample& corner) {
    set(kTop + 2, kLeft + 2, corner);
    const bool fails = !fill();
    set(kTop + 2, kLeft + 2, slope(kTop + 2, kLeft + 2));
    return fails && fill();
  };
  KeySamples::Sample other = slope(kTop + 2, kLeft + 2);
  other.group = 8;
  EXPECT_TRUE(fails_with(other)) << "another surface";
  other = slope(kTop + 2, kLeft + 2);
  other.light.hidden = 0;
  EXPECT_TRUE(fails_with(other)) << "another light";
  for (size_t c = 0; c < 3; ++c) {
    other = slope(kTop + 2, kLeft + 2);
    other.value[c] = static_cast<uint16_t>(other.value[c] + 8 * kCode);
    EXPECT_TRUE(fails_with(other)) << "brighter in channel " << c;
  }
}

/// A shadow thinner than the sample distance shows in some sample nearby and requires tracing. A
/// nearby sample of another surface does not.
TEST_F(FilledSamples, AreTracedNearAShadow) {
  KeySamples::Sample shadow = slope(kTop, kLeft);
  shadow.way = 78;
  for (const auto& [row, column, filled] : {std::tuple{-6, 0, false},
                                            {0, 8, false},
                                            {8, 8, false},
                                            {-6, -6, false},
                                            {-8, 0, true},
                                            {0, -8, true},
                                            {10, 2, true}}) {
    SCOPED_TRACE(::testing::Message() << row << ", " << column);
    set(kTop + row, kLeft + column, shadow);
    EXPECT_EQ(fill(), filled);
    KeySamples::Sample elsewhere = shadow;
    elsewhere.group = 8;
    set(kTop + row, kLeft + column, elsewhere);
    EXPECT_TRUE(fill());
    set(kTop + row, kLeft + column, slope(kTop + row, kLeft + column));
  }
}

TEST_F(FilledSamples, AreTracedAtTheBorders) {
  EXPECT_TRUE(samples_.fill(0, kCacheView, 0, tolerances_));
  const int last_row = (grid_.rows() - 1) / 2 * 2, last_column = (grid_.columns() - 1) / 2 * 2;
  EXPECT_FALSE(samples_.fill(last_row, kCacheView, 0, tolerances_));
  EXPECT_FALSE(samples_.fill(0, kCacheView, last_column, tolerances_));
}

TEST_F(FilledSamples, AreMarkedAsFilled) {
  const auto is_filled = [&] { return samples_.is_filled(kTop, kCacheView, kLeft); };
  EXPECT_FALSE(is_filled());
  ASSERT_TRUE(fill());
  EXPECT_TRUE(is_filled());
  KeySamples::Sample other = slope(kTop, kLeft);
  other.group = 8;
  set(kTop, kLeft, other);
  samples_.begin(grid_);
  EXPECT_TRUE(is_filled()) << "the frame before";
  ASSERT_FALSE(fill());
  EXPECT_FALSE(is_filled());
}

class ChangedSamples : public FilledSamples {
 protected:
  ChangedSamples() {
    mark_bends();
    samples_.watch_changes();
  }
  void mark_bends() {
    for (int row = 0; row < grid_.rows(); ++row) samples_.mark_bends(row, tolerances_);
  }
  [[nodiscard]] bool cell_changed(int row, int column) const {
    return samples_.cell_changed(row, static_cast<size_t>(kCacheView * grid_.stride() + column));
  }
};

TEST_F(ChangedSamples, IncludeThoseThatShowNothingNowOrBefore) {
  samples_.set_nothing(kTop, kCacheView, kLeft);
  EXPECT_TRUE(cell_changed(kTop, kLeft));
  samples_.watch_changes();
  samples_.set_nothing(kTop, kCacheView, kLeft);
  EXPECT_FALSE(cell_changed(kTop, kLeft));
  set(kTop, kLeft, slope(kTop, kLeft));
  EXPECT_TRUE(cell_changed(kTop, kLeft));
}

TEST_F(ChangedSamples, AreEmptyIfAllSamplesAreSetAgain) {
  for (int row = 0; row < grid_.rows(); ++row)
    for (int column = 0; column < grid_.columns(); ++column) set(row, column, slope(row, column));
  mark_bends();
  EXPECT_FALSE(samples_.rows_changed(0, grid_.rows() - 1));
}

/// Any difference marks all four cells around the sample, and no others.
TEST_F(ChangedSamples, AffectTheirFourCells) {
  const KeySamples::Sample same = slope(kTop, kLeft);
  std::vector<KeySamples::Sample> others(7, same);
  others[0].value[2] += 1;
  others[1].group += 1;
  others[2].way += 1;
  others[3].light.hidden += 1;
  others[4].light.secondary[1] += 0.1F;
  others[5].light.around += 0.1F;
  others[6].light.seen[0] += 1;
  for (const KeySamples::Sample& other : others) {
    set(kTop, kLeft, same);
    samples_.watch_changes();
    set(kTop, kLeft, other);
    for (int row = kTop - 2; row <= kTop + 1; ++row)
      for (int column = kLeft - 2; column <= kLeft + 1; ++column)
        EXPECT_EQ(cell_changed(row, column),
                  row >= kTop - 1 && row <= kTop && column >= kLeft - 1 && column <= kLeft)
            << row << ", " << column;
    EXPECT_TRUE(samples_.rows_changed(kTop, kTop));
    EXPECT_FALSE(samples_.rows_changed(0, kTop - 1));
    EXPECT_FALSE(samples_.rows_changed(kTop + 1, grid_.rows() - 1));
  }
}

/// A changed slope decides if cells may be interpolated, though their own samples are unchanged.
TEST_F(ChangedSamples, IncludeNeighboursOfAChangedSlope) {
  KeySamples::Sample brighter = slope(kTop, kLeft);
  for (uint16_t& value : brighter.value) value = static_cast<uint16_t>(value + 20 * kCode);
  set(kTop, kLeft, brighter);
  EXPECT_FALSE(cell_changed(kTop, kLeft + 1));
  mark_bends();
  EXPECT_TRUE(cell_changed(kTop, kLeft + 1));
  EXPECT_TRUE(cell_changed(kTop + 1, kLeft));
  EXPECT_FALSE(cell_changed(kTop, kLeft + 2));
}

}  // namespace
}  // namespace lenticule::render
