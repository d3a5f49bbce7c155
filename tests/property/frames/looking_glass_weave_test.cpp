// SPDX-License-Identifier: Apache-2.0
// Tests numbered views woven for an imported visual.json against the published formula, for every
// variant of the file and at every subpixel, including the four corners.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "frames/weave.h"
#include "frames/weaving/fast_weaver.h"
#include "optics/calibration_import.h"
#include "tests/support/oracles/looking_glass_oracle.h"

namespace lenticule::frames {
namespace {

struct VisualFile {
  int width, height;
  double pitch, slope, center, dpi;
  bool flip_x, flip_subpixels, inverted;
  int cell_mode;  ///< -1: stripes
};

/// The four cells that the patterns choose from.
using Cell = test::LookingGlassCell;
constexpr std::array<Cell, 4> kCells = {{{{{-0.25, 0.25}, {0.25, 0.25}, {0.0, -0.25}}},
                                         {{{-0.25, -0.25}, {0.25, -0.25}, {0.0, 0.25}}},
                                         {{{-0.3, 0.1}, {0.2, 0.2}, {0.1, -0.3}}},
                                         {{{0.3, 0.0}, {-0.2, -0.1}, {0.05, 0.3}}}}};

std::string json_of(const VisualFile& f) {
  std::string cells;
  for (const Cell& c : kCells)
    cells += fmt::format(
        R"({}{{"ROffsetX":{},"ROffsetY":{},"GOffsetX":{},"GOffsetY":{},"BOffsetX":{},"BOffsetY":{}}})",
        cells.empty() ? "" : ",", c[0][0], c[0][1], c[1][0], c[1][1], c[2][0], c[2][1]);
  const std::string cell_keys =
      f.cell_mode < 0 ? ""
                      : fmt::format(R"(,"CellPatternMode":{{"value":{}}},"subpixelCells":[{}])",
                                    f.cell_mode, cells);
  return fmt::format(
      R"({{"pitch":{{"value":{}}},"slope":{{"value":{}}},"center":{{"value":{}}},"DPI":{{"value":{}}},)"
      R"("screenW":{{"value":{}}},"screenH":{{"value":{}}},"flipImageX":{{"value":{}}},)"
      R"("flipSubp":{{"value":{}}},"invView":{{"value":{}}},"viewCone":{{"value":40}}{}}})",
      f.pitch, f.slope, f.center, f.dpi, f.width, f.height, f.flip_x ? 1 : 0,
      f.flip_subpixels ? 1 : 0, f.inverted ? 1 : 0, cell_keys);
}

/// Returns the published position among the views, in [0, 1): the view is floor(position * views).
double published_position(const VisualFile& f, int i, int j, int channel) {
  const test::LookingGlassFile numbers = {
      .width = double(f.width),
      .height = double(f.height),
      .pitch = f.pitch,
      .slope = f.slope,
      .center = f.center,
      .dpi = f.dpi,
      .flip_x = f.flip_x,
      .flip_subpixels = f.flip_subpixels,
      .inverted = f.inverted,
  };
  if (f.cell_mode < 0) return test::looking_glass::stripe_view(numbers, i, j, channel);
  const size_t cell = test::looking_glass::cell_index(f.cell_mode, i, f.height - 1 - j);
  return test::looking_glass::cell_view(numbers, kCells[cell], i, j, channel);
}

class PublishedWeave : public ::testing::TestWithParam<VisualFile> {};

TEST_P(PublishedWeave, PutsTheSameViewUnderEverySubpixel) {
  const VisualFile& file = GetParam();
  constexpr int kViews = 45;
  // A quilt of 9 x 5 one-pixel tiles, each with the code of its view.
  WovenFrame quilt({.width = 9, .height = 5});
  for (int view = 0; view < kViews; ++view)
    for (int c = 0; c < 3; ++c) quilt.row(4 - view / 9)[view % 9 * 3 + c] = uint8_t(5 * view);

  const auto imported = optics::import_looking_glass(json_of(file), "visual.json");
  const optics::OpticalModel model(imported.rig);
  const auto order = imported.views.inverted ? ViewOrder::LeftToRight : ViewOrder::RightToLeft;
  const ViewSet views(quilt, {.columns = 9, .rows = 5});
  const WeaveOptions options{
      .filter = ViewFilter::Nearest, .fit = PictureFit::Stretch, .order = order};
  const WovenFrame woven = weave(views, model, options);
  ASSERT_EQ(weave_fast(views, model, options), woven);

  int undecided = 0;
  for (int j = 0; j < file.height; ++j)
    for (int i = 0; i < file.width; ++i)
      for (int c = 0; c < 3; ++c) {
        const double view = published_position(file, i, j, c) * kViews;
        if (std::abs(view - std::round(view)) < 1e-6) {
          ++undecided;  // lies on a border between two views
          continue;
        }
        ASSERT_EQ(woven.row(j)[3 * i + c], 5 * static_cast<int>(view))
            << "pixel " << i << ", " << j << " channel " << c;
      }
  EXPECT_LT(undecided, file.width * file.height * 3 / 100);
}

constexpr VisualFile kPortrait = {192, 256, 52.5912, -7.0835, 0.1371, 324, false, false, true, -1};
VisualFile changed(void (*change)(VisualFile&)) {
  VisualFile file = kPortrait;
  change(file);
  return file;
}
INSTANTIATE_TEST_SUITE_P(
    Files, PublishedWeave,
    ::testing::Values(kPortrait, changed([](VisualFile& f) { f.inverted = false; }),
                      changed([](VisualFile& f) { f.flip_x = true; }),
                      changed([](VisualFile& f) { f.flip_subpixels = true; }),
                      changed([](VisualFile& f) { f.flip_x = f.flip_subpixels = true; }),
                      changed([](VisualFile& f) { f.flip_x = true, f.inverted = false; }),
                      changed([](VisualFile& f) { f.slope = 5.317; }),
                      changed([](VisualFile& f) { f.width = 255, f.height = 143; }),
                      changed([](VisualFile& f) { f.cell_mode = 0; }),
                      changed([](VisualFile& f) { f.cell_mode = 1; }),
                      changed([](VisualFile& f) { f.cell_mode = 2, f.height = 255; }),
                      changed([](VisualFile& f) { f.cell_mode = 3, f.height = 253; }),
                      changed([](VisualFile& f) { f.cell_mode = 4, f.flip_x = true; })));

}  // namespace
}  // namespace lenticule::frames
