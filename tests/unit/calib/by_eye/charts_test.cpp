// SPDX-License-Identifier: Apache-2.0
// Tests charts, subpixel by subpixel against the optical model, and as an eye sees them.
#include "frames/charts/charts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "base/error.h"
#include "calib/by_eye/questions.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

using frames::Chart;
using frames::ChartPattern;
using frames::WovenFrame;

optics::Rig chart_rig() {
  optics::Rig rig;
  rig.panel.width_px = 480;
  rig.panel.height_px = 300;
  rig.panel.pixel_width = Millimetres(0.3);
  rig.panel.pixel_height = Millimetres(0.3);
  rig.sheet.pitch = Subpixels(7.63);
  rig.sheet.slant = 0.21;
  rig.sheet.offset = Lenses(0.37);
  rig.sheet.gap = Millimetres(4.0);
  rig.sheet.refraction_shape = 0.45;
  rig.sheet.channel_offset = {Subpixels(0.2), Subpixels(0.0), Subpixels(-0.3)};
  rig.viewing.distance = Millimetres(600.0);
  rig.viewing.height = Millimetres(25.0);
  return rig;
}

struct Place {
  int i, j, channel;
  double place;  ///< -1/2 ... 1/2
};

/// Returns random subpixels, with the place that the model gives them for the eye on the viewing
/// line.
std::vector<Place> random_places(const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  std::mt19937 random(3);
  std::vector<Place> places;
  for (int n = 0; n < 20'000; ++n) {
    const int i = static_cast<int>(random() % static_cast<unsigned>(rig.panel.width_px));
    const int j = static_cast<int>(random() % static_cast<unsigned>(rig.panel.height_px));
    const int c = static_cast<int>(random() % 3);
    const Vec2 q = rig.panel.subpixel_centre_px(i, j, c);
    const double phase = model.phase(q.x, q.y, c, model.design_eye());
    places.push_back({i, j, c, phase - std::round(phase)});
  }
  return places;
}

bool lit(const WovenFrame& frame, const Place& p) {
  return frame.row(p.j)[3 * p.i + p.channel] != 0;
}

TEST(Charts, CombLightsAQuarterOfEveryLens) {
  const optics::Rig rig = chart_rig();
  const WovenFrame frame = frames::draw_chart({.pattern = ChartPattern::Comb, .rig = rig});
  for (const Place& p : random_places(rig)) {
    if (std::abs(std::abs(p.place) - 0.125) < 1e-7) continue;
    ASSERT_EQ(lit(frame, p), std::abs(p.place) < 0.125) << p.i << ' ' << p.j << ' ' << p.channel;
  }
}

TEST(Charts, BandsAreCombsWithDifferentPitches) {
  const optics::Rig rig = chart_rig();
  constexpr double kReach = 0.1;
  const WovenFrame frame = frames::draw_chart(
      {.pattern = ChartPattern::Bands, .rig = rig, .band_reach = kReach, .cursor = 0});
  for (const int band : {1, 7, 12, 24}) {
    optics::Rig own = rig;
    const SheetValues seen = sheet_values(rig, 600.0);
    SheetValues values = seen;
    values.effective_pitch_subpx *= frames::band_scale(band, kReach);
    own = with_sheet_values(rig, values, 600.0);
    int compared = 0;
    for (const Place& p : random_places(own)) {
      if (p.j * frames::kBands / rig.panel.height_px != band || p.j % (300 / frames::kBands) < 2)
        continue;
      // The marked band has the exact offset, these rigs the paraxial one.
      if (std::abs(std::abs(p.place) - 0.125) < 1e-3) continue;
      ASSERT_EQ(lit(frame, p), std::abs(p.place) < 0.125) << band;
      ++compared;
    }
    EXPECT_GT(compared, 100);
  }
}

TEST(Charts, TheMarkedBandIsBlueAtBothEnds) {
  const WovenFrame frame = frames::draw_chart(
      {.pattern = ChartPattern::Bands, .rig = chart_rig(), .band_reach = 0.01, .cursor = 3});
  for (const int x : {0, 460})
    for (const int band : {2, 3, 4}) {
      int blue = 0;
      for (int i = x; i < x + 20; ++i) {
        const uint8_t* p = frame.row(band * 12 + 6) + 3 * static_cast<ptrdiff_t>(i);
        blue += p[0] == 0 && p[1] == 0 && p[2] == 255 ? 1 : 0;
      }
      EXPECT_EQ(blue == 20, band == 3) << x << ' ' << band;
    }
}

TEST(Charts, SlantBandsAreCombsWithDifferentSlants) {
  const optics::Rig rig = chart_rig();
  constexpr double kReach = 0.05;
  const WovenFrame frame = frames::draw_chart(
      {.pattern = ChartPattern::SlantBands, .rig = rig, .band_reach = kReach, .cursor = 0});
  for (const int band : {1, 7, 12, 24}) {
    SheetValues values = sheet_values(rig, 600.0);
    values.slant += frames::band_shift(ChartPattern::SlantBands, band, kReach);
    int compared = 0;
    for (const Place& p : random_places(with_sheet_values(rig, values, 600.0))) {
      const int left = 480 * band / frames::kBands, right = 480 * (band + 1) / frames::kBands;
      if (p.i < left + (right - left) / 8 || p.i >= right) continue;
      // The chart has the paraxial phase of the slant, these rigs the exact one.
      if (std::abs(std::abs(p.place) - 0.125) < 0.02) continue;
      ASSERT_EQ(lit(frame, p), std::abs(p.place) < 0.125) << band;
      ++compared;
    }
    EXPECT_GT(compared, 100);
  }
}

TEST(Charts, RungsOfALadderAreTwoViewsThatAreShifted) {
  const optics::Rig rig = chart_rig();
  constexpr double kReach = 0.4, kX = 0.2, kY = -0.105;
  const WovenFrame frame = frames::draw_chart({.pattern = ChartPattern::Ladder,
                                               .rig = rig,
                                               .band_reach = kReach,
                                               .cursor = -1,
                                               .ladder_x = kX,
                                               .ladder_y = kY});
  int inside = 0;
  for (const Place& p : random_places(rig)) {
    const double x = (p.i + 0.5) / 480.0 - 0.5 - kX;
    const double rung = ((p.j + 0.5) / 300.0 - frames::rung_y(kY, 0) - 0.5) /
                        (frames::kLadderHeight / frames::kBands);
    const int nearest = static_cast<int>(std::round(rung));
    if (std::abs(x) > 0.5 * frames::kLadderWidth + 0.003 || nearest < 0 ||
        nearest >= frames::kBands) {
      ASSERT_FALSE(lit(frame, p));
      continue;
    }
    if (std::abs(x) > 0.5 * frames::kLadderWidth - 0.003) continue;
    double place = p.place + frames::band_shift(ChartPattern::Ladder, nearest, kReach);
    place -= std::round(place);
    if (std::abs(place) < 1e-7 || std::abs(place) > 0.5 - 1e-7) continue;
    ASSERT_EQ(lit(frame, p), p.channel == 0 ? place > 0.0 : p.channel == 1 && place < 0.0);
    ++inside;
  }
  EXPECT_GT(inside, 300);
}

TEST(Charts, BlueMarksShowTheChosenColumnAndRung) {
  const auto is_blue = [](const WovenFrame& frame, int i, int j) {
    const uint8_t* p = frame.row(j) + 3 * static_cast<ptrdiff_t>(i);
    return p[0] == 0 && p[1] == 0 && p[2] == 255;
  };
  Chart chart{.pattern = ChartPattern::SlantBands, .rig = chart_rig(), .band_reach = 0.05};
  chart.cursor = 12;
  const WovenFrame columns = frames::draw_chart(chart);
  for (const int j : {0, 299}) {
    EXPECT_TRUE(is_blue(columns, 240, j));
    EXPECT_FALSE(is_blue(columns, 220, j));
  }
  EXPECT_FALSE(is_blue(columns, 240, 150));
  chart.pattern = ChartPattern::Ladder;
  const WovenFrame ladder = frames::draw_chart(chart);
  for (const int i : {240 - 40, 240 + 40}) {
    EXPECT_TRUE(is_blue(ladder, i, 150));
    EXPECT_FALSE(is_blue(ladder, i, 140));
  }
}

TEST(Charts, WordsMoveToTheTopIfTheLadderIsBelow) {
  Chart chart{.pattern = ChartPattern::Ladder, .rig = chart_rig(), .band_reach = 0.5};
  chart.ladder_y = 0.34;
  chart.words = {"rung"};
  chart.words_on_top = true;
  const WovenFrame full = frames::draw_chart(chart);
  chart.words.clear();
  const WovenFrame plain = frames::draw_chart(chart);
  EXPECT_NE(full, plain);
  for (int j = 150; j < 300; ++j)
    ASSERT_TRUE(std::equal(full.row(j), full.row(j) + 480 * 3, plain.row(j))) << j;
}

TEST(Charts, TwoViewsAreRedForTheLeftEyeAndGreenForTheRight) {
  const optics::Rig rig = chart_rig();
  const WovenFrame frame = frames::draw_chart({.pattern = ChartPattern::TwoViews, .rig = rig});
  for (const Place& p : random_places(rig)) {
    if (std::abs(p.place) < 1e-7 || std::abs(p.place) > 0.5 - 1e-7) continue;
    const bool wanted = p.channel == 0 ? p.place > 0 : p.channel == 1 && p.place < 0;
    ASSERT_EQ(lit(frame, p), wanted);
  }
  const optics::OpticalModel model(rig);
  for (const double x : {-30.0, 30.0}) {
    const optics::RgbPicture seen =
        optics::simulate_eye(model, {frame.bytes().data(), 480, 300, frame.geometry().row_bytes()},
                             {.x = x, .y = 25.0, .z_mm = 600.0}, {.width = 60, .height = 40});
    int64_t red = 0, green = 0;
    for (size_t n = 0; n < seen.pixels.size(); n += 3) {
      red += seen.pixels[n];
      green += seen.pixels[n + 1];
    }
    EXPECT_GT(x < 0 ? red : green, 50 * (x < 0 ? green : red));
  }
}

/// Three numbers at 7.6 subpixels a lens: 0 has 19 dots, 1 has 13 and 2 has 15.
TEST(Charts, NumbersCountUpToTheRight) {
  const optics::Rig rig = chart_rig();
  const WovenFrame frame = frames::draw_chart({.pattern = ChartPattern::NumberedViews, .rig = rig});
  const optics::OpticalModel model(rig);
  const double lobe = model.lobe_width_mm(600.0);
  const auto light_at = [&](double x_mm) {
    const optics::RgbPicture seen =
        optics::simulate_eye(model, {frame.bytes().data(), 480, 300, frame.geometry().row_bytes()},
                             {.x = x_mm, .y = 25.0, .z_mm = 600.0}, {.width = 480, .height = 300});
    return std::accumulate(seen.pixels.begin(), seen.pixels.end(), int64_t{0});
  };
  const int64_t left = light_at(-lobe / 3.0), middle = light_at(0.0), right = light_at(lobe / 3.0);
  EXPECT_GT(left, right);
  EXPECT_GT(right, middle);
  EXPECT_GT(light_at(lobe * 2.0 / 3.0), right) << "the next zone begins with 0 again";
}

TEST(Charts, PixelLinesAreOnePixelWide) {
  const WovenFrame frame =
      frames::draw_chart({.pattern = ChartPattern::PixelLines, .rig = chart_rig()});
  for (const int j : {0, 1, 100}) {
    for (int i = 0; i < 480; ++i) {
      const uint8_t* p = frame.row(j) + 3 * static_cast<ptrdiff_t>(i);
      const int wanted = (i < 240 ? i : j) % 3;
      for (int c = 0; c < 3; ++c) ASSERT_EQ(p[c], c == wanted ? 255 : 0);
    }
  }
}

TEST(Charts, WordsAndMagnifierStayInTheirPlaces) {
  Chart chart{.pattern = ChartPattern::Comb, .rig = chart_rig()};
  const WovenFrame plain = frames::draw_chart(chart);
  chart.magnifier = true;
  chart.words = {"2 of 9: slant", std::string(2000, 'x')};
  const WovenFrame full = frames::draw_chart(chart);
  // The middle band shows the pattern in every chart.
  for (int j = 130; j < 175; ++j)
    EXPECT_TRUE(std::equal(full.row(j), full.row(j) + 480 * 3, plain.row(j))) << j;
  EXPECT_NE(full, plain);
  // The magnified pixels are those of the panel's middle.
  const int zoom = std::min(480 / 3 / 24, 300 / 3 / 16);
  for (int j = 0; j < 16; ++j)
    for (int i = 0; i < 24; ++i)
      for (int c = 0; c < 3; ++c)
        ASSERT_EQ(full.row((j + 1) * zoom)[3 * (i + 1) * zoom + c],
                  plain.row(142 + j)[3 * (228 + i) + c]);
}

TEST(Charts, DrawsTinyAndUnusualPanels) {
  for (const auto& [width, height] : {std::pair{1, 1}, {3, 1}, {1, 40}, {17, 5}}) {
    optics::Rig rig = chart_rig();
    rig.panel.width_px = width;
    rig.panel.height_px = height;
    for (const ChartPattern pattern :
         {ChartPattern::PixelLines, ChartPattern::Bands, ChartPattern::Comb, ChartPattern::TwoViews,
          ChartPattern::NumberedViews, ChartPattern::SlantBands, ChartPattern::Ladder}) {
      const WovenFrame frame = frames::draw_chart({.pattern = pattern,
                                                   .rig = rig,
                                                   .band_reach = 0.1,
                                                   .cursor = 24,
                                                   .magnifier = true,
                                                   .words = {"words", ""}});
      EXPECT_EQ(frame.width(), width);
    }
  }
  EXPECT_THROW((void)frames::draw_chart({.rig = {}}), Error);
}

}  // namespace
}  // namespace lenticule::calib
