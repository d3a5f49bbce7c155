// SPDX-License-Identifier: Apache-2.0
// Tests links that lose chroma, and panels with an unexpected subpixel layout.
#include "lab/panel/driven_panel.h"

#include <gtest/gtest.h>

#include "bench_stage.h"

namespace lenticule::lab {
namespace {

void expect_finds_all_centres(const optics::Panel& panel, double half_x, double half_y) {
  const SubpixelFinder finder(panel,
                              0.19);  // the openings cover 0.9 of the width and of the height
  for (int channel = 0; channel < 3; ++channel) {
    const Vec2 at = panel.subpixel_centre_px(5, 3, channel);
    const SubpixelId id = static_cast<SubpixelId>((3 * panel.width_px + 5) * 4 + channel);
    EXPECT_EQ(finder.find(at.x, at.y), id);
    EXPECT_EQ(finder.find(at.x + 0.89 * half_x, at.y - 0.89 * half_y), id);
    EXPECT_NE(finder.find(at.x + 0.91 * half_x, at.y), id);
    EXPECT_NE(finder.find(at.x, at.y - 0.91 * half_y), id);
  }
}

TEST(SubpixelFinder, KnowsEveryLayout) {
  optics::Panel panel = small_panel(12, 8);
  for (const char* name : {"rgb", "bgr"}) {
    panel.layout = optics::SubpixelLayout::named(name);
    expect_finds_all_centres(panel, 1.0 / 6.0, 0.5);
  }
  for (const char* name : {"vrgb", "vbgr"}) {
    panel.layout = optics::SubpixelLayout::named(name);
    expect_finds_all_centres(panel, 0.5, 1.0 / 6.0);
  }
  const optics::PixelCell one{{{0.2, 0.5}, {0.53, 0.5}, {0.87, 0.5}}};
  const optics::PixelCell other{{{-0.2, 0.5}, {0.13, 0.5}, {0.47, 0.5}}};
  panel.layout = optics::SubpixelLayout::cells(1, 2, {one, other});
  expect_finds_all_centres(panel, 1.0 / 6.0, 0.5);
}

TEST(SubpixelFinder, FindsNothingInTheBlackMatrixAndBesideThePanel) {
  const optics::Panel panel = small_panel(12, 8);
  const SubpixelFinder finder(panel, 0.3);
  EXPECT_FALSE(finder.find(1.0 / 3.0, 0.5));
  EXPECT_FALSE(finder.find(0.5, 2.0));
  EXPECT_FALSE(finder.find(-0.5, 0.5));
  EXPECT_FALSE(finder.find(12.5, 0.5));
  EXPECT_FALSE(finder.find(0.5, 8.5));
  EXPECT_FALSE(finder.find(std::nan(""), 0.5));
}

/// Returns red columns, alternately lit and dark.
frames::WovenFrame red_columns(int width, int height) {
  frames::WovenFrame frame({width, height, frames::PixelFormat::Rgb8});
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; i += 2) frame.row(j)[i * 3] = 255;
  }
  return frame;
}

TEST(PanelLink, KeepsEveryCodeWithFullChroma) {
  const frames::WovenFrame frame = red_columns(5, 3);
  const DrivenFrame driven = drive(frame.view(), Chroma::Full);
  for (size_t pixel = 0; pixel < 15; ++pixel) {
    EXPECT_EQ(driven.codes[pixel * 4], pixel % 5 % 2 == 0 ? 255 : 0);
    EXPECT_EQ(driven.codes[pixel * 4 + 1], 0);
    EXPECT_EQ(driven.codes[pixel * 4 + 2], 0);
  }
}

TEST(PanelLink, SharedChromaLeaksIntoOtherColours) {
  for (const Chroma chroma : {Chroma::HalfWidth, Chroma::HalfBoth}) {
    const DrivenFrame driven = drive(red_columns(6, 4).view(), chroma);
    // Y = 54.2 and 0; the shared Cr = 63.75 and Cb = -14.6.
    EXPECT_NEAR(driven.codes[0], 54 + 1.5748 * 64, 1.5);
    EXPECT_NEAR(driven.codes[1], 54 - 0.4681 * 64 + 0.1873 * 15, 1.5);
    EXPECT_NEAR(driven.codes[4], 1.5748 * 64, 1.5);
    EXPECT_EQ(driven.codes[5], 0);
  }
}

TEST(PanelLink, GreySurvivesSharedChroma) {
  const frames::WovenFrame grey = plain_frame(small_panel(7, 5), 90, 90, 90);
  const DrivenFrame driven = drive(grey.view(), Chroma::HalfBoth);
  for (size_t pixel = 0; pixel < 35; ++pixel) {
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(driven.codes[pixel * 4 + c], 90);
  }
}

TEST(PanelLink, OnlyTwoByTwoSubsamplingMixesRows) {
  frames::WovenFrame rows({2, 2, frames::PixelFormat::Rgb8});
  rows.row(0)[0] = rows.row(0)[3] = 255;  // a red row above a black one
  const DrivenFrame half_width = drive(rows.view(), Chroma::HalfWidth);
  EXPECT_EQ(half_width.codes[0], 255);
  EXPECT_EQ(half_width.codes[8], 0);
  const DrivenFrame half_both = drive(rows.view(), Chroma::HalfBoth);
  EXPECT_LT(half_both.codes[0], 200);
  EXPECT_GT(half_both.codes[8], 50);
}

TEST(PanelLink, TheCameraSeesTheLeakedColour) {
  const optics::Panel panel = small_panel(320, 180);
  SimulatedCamera camera = quiet_camera(160, 120);
  camera.bayer = true;
  const SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  double green[2] = {};
  for (int shared = 0; shared < 2; ++shared) {
    SimulatedPanelLink link;
    link.chroma = shared == 1 ? Chroma::HalfBoth : Chroma::Full;
    SimulatedBench bench(panel, sheet, link, camera, 1);
    const calib::CameraPicture picture = look(bench, red_columns(320, 180));
    for (size_t i = 1; i < picture.light.size(); i += 3) green[shared] += double{picture.light[i]};
  }
  EXPECT_EQ(green[0], 0.0);
  EXPECT_GT(green[1], 1.0);
}

/// Returns the mean light of a panel that lights only its first channel where `phase` of the
/// assumed layout is near a lens's centre.
double red_comb_light(SimulatedBench& bench, const optics::Panel& believed, Vec3 eye) {
  frames::WovenFrame frame({believed.width_px, believed.height_px, frames::PixelFormat::Rgb8});
  for (int j = 60; j < 120; ++j) {
    for (int i = 100; i < 220; ++i) {
      const Vec2 at = believed.subpixel_centre_px(i, j, 0);
      const double phase = bench.ground_truth_phase(at.x, at.y, 0, eye);
      if (std::abs(phase - std::round(phase)) < 0.1) frame.row(j)[i * 3] = 255;
    }
  }
  double sum = 0.0;
  for (const float light : look(bench, frame).light) sum += double{light};
  return sum;
}

TEST(PanelLink, ActualLayoutMovesTheLight) {
  const optics::Panel panel = small_panel(320, 180);
  const SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  const SimulatedCamera camera = quiet_camera(160, 120);
  SimulatedPanelLink swapped;
  swapped.actual_layout = optics::SubpixelLayout::bgr();
  SimulatedBench as_believed(panel, sheet, {}, camera, 1);
  SimulatedBench as_built(panel, sheet, swapped, camera, 1);
  const double good = red_comb_light(as_believed, panel, camera.position_mm);
  EXPECT_LT(red_comb_light(as_built, panel, camera.position_mm), 0.5 * good);
}

TEST(Haze, FillsTheDarkPhases) {
  const optics::Panel panel = small_panel(320, 180);
  SimulatedCamera camera = quiet_camera(160, 120);
  camera.samples = 30;
  SimulatedSheet sheet = focused_sheet(panel, 7.7, 0.25);
  double contrast[2] = {};
  double mean[2] = {};
  for (int hazy = 0; hazy < 2; ++hazy) {
    sheet.haze = hazy == 1 ? 0.4 : 0.0;
    SimulatedBench bench(panel, sheet, {}, camera, 1);
    const calib::CameraPicture picture = look(bench, fringe_frame(panel, 8.2, 0.25, 0.0));
    double squares = 0.0;
    for (int row = 50; row < 70; ++row) {
      for (int column = 40; column < 120; ++column) {
        const double light = double{light_at(picture, column, row, 0)};
        mean[hazy] += light / 1600.0;
        squares += light * light / 1600.0;
      }
    }
    contrast[hazy] = std::sqrt(squares - mean[hazy] * mean[hazy]);
  }
  EXPECT_NEAR(mean[1], mean[0], 0.02);
  EXPECT_NEAR(contrast[1] / contrast[0], 0.6, 0.05);
}

}  // namespace
}  // namespace lenticule::lab
