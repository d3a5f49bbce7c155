// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/harness/svg_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr auto kLinear = AxisScale::Linear;
constexpr auto kLog = AxisScale::Log;

TEST(AxisTicks, AreRoundAndCoverTheNumbers) {
  EXPECT_THAT(axis_ticks(1, 7, kLinear), ElementsAre(0, 2, 4, 6, 8));
  EXPECT_THAT(axis_ticks(-3, 3, kLinear), ElementsAre(-3, -2, -1, 0, 1, 2, 3));
  EXPECT_THAT(axis_ticks(10, 20, kLog), ElementsAre(10, 20));
  EXPECT_THAT(axis_ticks(3, 40, kLog), ElementsAre(2, 5, 10, 20, 50));
  EXPECT_THAT(axis_ticks(1, 3e4, kLog), ElementsAre(1, 10, 100, 1000, 10000, 100000));
}

TEST(AxisTicks, SpanARangeForASingleValue) {
  for (const auto scale : {kLinear, kLog}) {
    for (const double at : {0.0001, 1.0, 5.0, 123456.0}) {
      const std::vector<double> ticks = axis_ticks(at, at, scale);
      ASSERT_GE(ticks.size(), 2U);
      EXPECT_LE(ticks.front(), at);
      EXPECT_GE(ticks.back(), at);
      EXPECT_LT(ticks.front(), ticks.back());
    }
  }
}

TEST(AxisTicks, StayFewAndAscendOverAWideRange) {
  for (const auto scale : {kLinear, kLog}) {
    const std::vector<double> ticks = axis_ticks(1e-7, 1e9, scale);
    EXPECT_LE(ticks.size(), 20U);
    EXPECT_TRUE(std::is_sorted(ticks.begin(), ticks.end()));
    EXPECT_LE(ticks.front(), 1e-7);
    EXPECT_GE(ticks.back(), 1e9);
  }
}

Plot two_lines() {
  Plot plot;
  plot.title = "a < b";
  plot.x = {.label = "x & x", .scale = kLog};
  plot.y = {.label = "y"};
  plot.series = {{.label = "first", .points = {{1, 0}, {10, 2}, {100, 4}}},
                 {.label = "\"second\"", .points = {{1, 1}, {100, 3}}}};
  return plot;
}

TEST(SvgPlot, PlacesPointsByTheAxes) {
  Plot plot = two_lines();
  plot.x.scale = kLinear;
  plot.series = {{.label = "line", .points = {{0, 0}, {5, 5}, {10, 10}}}};
  // Left, middle and right; bottom, middle and top.
  EXPECT_THAT(svg_of(plot), HasSubstr("M84.0 364.0L327.0 202.0L570.0 40.0"));
}

TEST(SvgPlot, ALogarithmicAxisGivesEveryDecadeTheSameLength) {
  Plot plot = two_lines();
  plot.series = {{.label = "line", .points = {{1, 0}, {100, 2}, {10000, 4}}}};
  EXPECT_THAT(svg_of(plot), HasSubstr("M84.0 364.0L327.0 202.0L570.0 40.0"));
}

TEST(SvgPlot, MarksCanBeDrawnWithoutALine) {
  Plot plot = two_lines();
  plot.x.scale = kLinear;
  plot.series = {{.label = "marks",
                  .points = {{0, 0}, {5, 5}, {10, 10}},
                  .joined = false,
                  .names = {"one", "<two>"}}};
  const std::string svg = svg_of(plot);
  EXPECT_THAT(svg, HasSubstr(R"(<circle cx="327.0" cy="202.0")"));
  EXPECT_THAT(svg, HasSubstr("<title>&lt;two&gt;</title>"));
  EXPECT_THAT(svg, Not(HasSubstr("L327.0")));
}

TEST(SvgPlot, LabelsEverythingAndEscapesText) {
  const std::string svg = svg_of(two_lines());
  for (const char* text : {">a &lt; b<", ">x &amp; x<", ">y<", ">first<", ">&quot;second&quot;<"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_TRUE(svg.starts_with("<svg "));
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
}

}  // namespace
}  // namespace lenticule::bench
