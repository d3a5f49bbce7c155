// SPDX-License-Identifier: Apache-2.0
// Tests patterns against their formulas in plain form.
#include "calib/measure/pattern.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "calib/measure/viewpoint.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

optics::Panel panel_of(const optics::SubpixelLayout& layout) {
  optics::Panel panel;
  panel.width_px = 480;
  panel.height_px = 270;
  panel.pixel_width = panel.pixel_height = Millimetres(0.2);
  panel.layout = layout;
  return panel;
}

frames::WovenFrame drawn(const Pattern& pattern, const optics::Panel& panel) {
  frames::WovenFrame frame;
  draw_pattern(pattern, panel, frame);
  return frame;
}

/// Returns the code for a phase in turns, by the formula.
int sinusoid_code(double turns) {
  const double light = 0.5 + 0.5 * kPatternDepth * std::cos(2.0 * std::numbers::pi * turns);
  return frames::code_from_linear(light);
}

class PatternOnLayouts : public testing::TestWithParam<const char*> {
 protected:
  optics::Panel panel_ = panel_of(optics::SubpixelLayout::named(GetParam()));
};

TEST_P(PatternOnLayouts, FringesFollowEverySubpixelsPosition) {
  const Fringe fringe{.pitch_subpx = 7.701, .slant = -0.3, .phase = 0.37};
  const frames::WovenFrame frame = drawn({.shape = fringe, .channels = {}}, panel_);
  for (int j = 0; j < panel_.height_px; j += 7)
    for (int i = 0; i < panel_.width_px; ++i)
      for (int c = 0; c < 3; ++c) {
        const Vec2 p = panel_.subpixel_centre_px(i, j, c);
        const double s = 3.0 * ((p.x - 240.0) + fringe.slant * (p.y - 135.0));
        const int wanted = sinusoid_code(s / fringe.pitch_subpx - fringe.phase);
        // A 4096th of a turn is less than one code.
        ASSERT_NEAR(frame.row(j)[3 * i + c], wanted, 1) << i << ' ' << j << ' ' << c;
      }
}

TEST_P(PatternOnLayouts, WavesVaryAlongOneAxisOnly) {
  for (const bool vertical : {false, true}) {
    const Wave wave{.vertical = vertical, .period_px = 60.0, .phase = 0.1};
    const frames::WovenFrame frame = drawn({.shape = wave, .channels = {}}, panel_);
    for (int j = 0; j < panel_.height_px; j += 11)
      for (int i = 0; i < panel_.width_px; i += 3)
        for (int c = 0; c < 3; ++c) {
          const Vec2 p = panel_.subpixel_centre_px(i, j, c);
          const double at = vertical ? p.y : p.x;
          ASSERT_NEAR(frame.row(j)[3 * i + c], sinusoid_code(at / 60.0 - 0.1), 1);
        }
  }
}

INSTANTIATE_TEST_SUITE_P(All, PatternOnLayouts, testing::Values("rgb", "bgr", "vrgb", "vbgr"));

TEST(Pattern, DisabledChannelsStayDark) {
  const optics::Panel panel = panel_of({});
  const frames::WovenFrame frame =
      drawn({.shape = Flat{{1.0, 1.0, 1.0}}, .channels = Channels::only(1)}, panel);
  for (int i = 0; i < panel.width_px; ++i) {
    EXPECT_EQ(frame.row(5)[3 * i], 0);
    EXPECT_EQ(frame.row(5)[3 * i + 1], 255);
    EXPECT_EQ(frame.row(5)[3 * i + 2], 0);
  }
}

TEST(Pattern, CombLightsOnePlaceUnderEachLens) {
  const optics::Panel panel = panel_of({});
  const LinearPhase phase{.constant = 0.2, .per_px_x = 0.05, .per_px_y = 0.013};
  const frames::WovenFrame frame =
      drawn({.shape = Comb{.phase = phase, .place = -0.25, .width = 0.2}, .channels = {}}, panel);
  int lit = 0;
  for (int j = 0; j < panel.height_px; ++j)
    for (int i = 0; i < panel.width_px; ++i) {
      const double off = phase.at(panel.subpixel_centre_px(i, j, 1), panel) + 0.25;
      const bool wanted = std::abs(off - std::round(off)) < 0.1;
      ASSERT_EQ(frame.row(j)[3 * i + 1], wanted ? 255 : 0);
      lit += wanted ? 1 : 0;
    }
  EXPECT_NEAR(lit, 0.2 * panel.width_px * panel.height_px, 0.01 * lit);
}

TEST(Pattern, ColumnsAndCheckerboardsLightHalfThePixels) {
  const optics::Panel panel = panel_of({});
  const frames::WovenFrame columns = drawn({.shape = Columns{}, .channels = {}}, panel);
  const frames::WovenFrame checks = drawn({.shape = Checks{}, .channels = {}}, panel);
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(columns.row(j)[3 * i], i % 2 == 0 ? 255 : 0);
      EXPECT_EQ(checks.row(j)[3 * i], (i + j) % 2 == 0 ? 255 : 0);
    }
}

/// Returns the lit cells, one bit each from the left.
int lit_cells(const frames::WovenFrame& frame, const MarkCells& cells) {
  int bits = 0;
  for (int cell = 0; cell < cells.count; ++cell) {
    const int x = cells.left + cell * cells.cell_width + cells.cell_width / 2;
    if (frame.row(cells.top + cells.height / 2)[3 * x] == 255) bits |= 1 << cell;
  }
  return bits;
}

TEST(Pattern, MarksEncodeTheirNumberAndCoverNothingElse) {
  const optics::Panel panel = panel_of({});
  for (const int code : {kNoCode, 0, 5, 7}) {
    const MarkCells cells = MarkCells::of(panel, code != kNoCode);
    for (int mark = 0; mark < kMarkCounts; ++mark) {
      const frames::WovenFrame frame = drawn(
          {.shape = Flat{{1.0, 1.0, 1.0}}, .channels = {}, .mark = mark, .code = code}, panel);
      const int parity = (mark & 1) ^ (mark >> 1);
      EXPECT_EQ(lit_cells(frame, cells), 1 | (mark & 1) << 1 | (mark >> 1) << 2 | parity << 3 |
                                             (code != kNoCode ? code << 4 : 0));
      for (int j = 0; j < panel.height_px; ++j)
        for (int i = 0; i < panel.width_px; ++i)
          ASSERT_TRUE(frame.row(j)[3 * i] == 255 || cells.covers(i + 0.5, j + 0.5));
    }
  }
}

TEST(PhaseSteps, ContainEveryPhaseOnceWithoutNeighbours) {
  for (const int count : {3, 4, 8, 16}) {
    const std::vector<double> phases = phase_steps(count);
    const std::set<double> distinct(phases.begin(), phases.end());
    EXPECT_EQ(distinct.size(), static_cast<size_t>(count));
    for (const double phase : phases) EXPECT_DOUBLE_EQ(phase * count, std::round(phase * count));
    if (count < 8) continue;
    for (size_t k = 1; k < phases.size(); ++k) {
      const double apart = std::abs(phases[k] - phases[k - 1]) * count;
      EXPECT_GT(std::min(apart, count - apart), 1.5);
    }
  }
}

}  // namespace
}  // namespace lenticule::calib
