// SPDX-License-Identifier: Apache-2.0
// Tests imported calibrations against the formulas of their own systems, evaluated here as
// published.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "base/error.h"
#include "optics/calibration_import.h"
#include "optics/model.h"
#include "tests/support/oracles/looking_glass_oracle.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

using nlohmann::json;

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}

/// Returns the distance of two phases modulo whole lenses.
double apart(double a, double b) { return std::abs(std::remainder(a - b, 1.0)); }

double fract(double v) { return v - std::floor(v); }

double number(const json& file, const char* key) {
  const json& value = file.at(key);
  return value.is_object() ? value.at("value").get<double>() : value.get<double>();
}

/// The four corners first, then random pixels.
struct Pixel {
  int i;
  int j;
};
Pixel sample(std::mt19937_64& random, int n, int w, int h) {
  if (n < 4) return {(n % 2) * (w - 1), (n / 2) * (h - 1)};
  return {static_cast<int>(random() % static_cast<uint64_t>(w)),
          static_cast<int>(random() % static_cast<uint64_t>(h))};
}

double our_phase(const OpticalModel& model, int i, int j, int c) {
  const Vec2 q = model.rig().panel.subpixel_centre_px(i, j, c);
  return model.phase(q.x, q.y, c, model.design_eye());
}

// --- Looking Glass, stripes

test::LookingGlassFile numbers_of(const json& file) {
  return {.width = number(file, "screenW"),
          .height = number(file, "screenH"),
          .pitch = number(file, "pitch"),
          .slope = number(file, "slope"),
          .center = number(file, "center"),
          .dpi = number(file, "DPI"),
          .flip_x = number(file, "flipImageX") != 0.0,
          .flip_subpixels = number(file, "flipSubp") != 0.0,
          .inverted = number(file, "invView") != 0.0};
}

double classic_coordinate(const json& file, int i, int j, int channel) {
  return test::looking_glass::stripe_coordinate(numbers_of(file), i, j, channel);
}

json random_visual(std::mt19937_64& random, bool wrap) {
  const auto value = [wrap](double v) { return wrap ? json{{"value", v}} : json(v); };
  const double slope = uniform(random, 2.0, 9.0) * (random() % 2 == 0 ? 1 : -1);
  return {{"configVersion", "1.0"},
          {"serial", "LKG-TEST"},
          {"pitch", value(uniform(random, 30.0, 80.0))},
          {"slope", value(slope)},
          {"center", value(uniform(random, -3.0, 3.0))},
          {"viewCone", value(uniform(random, 20.0, 60.0))},
          {"invView", value(static_cast<double>(random() % 2))},
          {"DPI", value(uniform(random, 120.0, 500.0))},
          {"screenW", value(1536 + static_cast<double>(random() % 3))},
          {"screenH", value(2048 + static_cast<double>(random() % 3))},
          {"flipImageX", value(static_cast<double>(random() % 2))},
          {"flipImageY", value(0.0)},
          {"flipSubp", value(static_cast<double>(random() % 2))}};
}

TEST(LookingGlassImport, GivesTheClassicShadersPhases) {
  std::mt19937_64 random(101);
  for (int r = 0; r < 100; ++r) {
    const json file = random_visual(random, r % 2 == 0);
    const LookingGlassImport imported = import_looking_glass(file.dump(), "visual.json");
    const OpticalModel model(imported.rig);
    const Panel& panel = imported.rig.panel;
    EXPECT_EQ(imported.views.inverted, number(file, "invView") != 0.0);
    for (int n = 0; n < 60; ++n) {
      const auto [i, j] = sample(random, n, panel.width_px, panel.height_px);
      for (int c = 0; c < 3; ++c) {
        ASSERT_LT(apart(our_phase(model, i, j, c) + 0.5, classic_coordinate(file, i, j, c)), 1e-6)
            << "pixel " << i << ", " << j << " channel " << c;
      }
    }
  }
}

/// A device of the first generation that is built mirrored: red is at the right of each pixel.
TEST(LookingGlassImport, FlipImageXReversesLensesAndSubpixels) {
  const json file = {{"pitch", 47.56},  {"slope", 5.48},   {"center", 0.2}, {"DPI", 338},
                     {"screenW", 2560}, {"screenH", 1600}, {"invView", 1},  {"flipImageX", 1},
                     {"flipImageY", 0}, {"flipSubp", 0},   {"viewCone", 40}};
  const Rig rig = import_looking_glass(file.dump(), "classic").rig;
  EXPECT_EQ(rig.panel.layout.name(), "bgr");
  EXPECT_NEAR(rig.sheet.slant, 1.0 / 5.48, 1e-12);
  const OpticalModel model(rig);
  for (const auto& [i, j] : {Pixel{0, 0}, Pixel{2559, 0}, Pixel{0, 1599}, Pixel{2559, 1599}})
    for (int c = 0; c < 3; ++c)
      EXPECT_LT(apart(0.5 - our_phase(model, i, j, c),
                      test::looking_glass::stripe_view(numbers_of(file), i, j, c)),
                1e-9);
}

TEST(LookingGlassImport, BothFlipsLeaveTheSubpixelsInOrder) {
  json file = {{"pitch", 47.56}, {"slope", 5.48},   {"center", 0.2},
               {"DPI", 338},     {"screenW", 2560}, {"screenH", 1600},
               {"invView", 0},   {"flipImageX", 1}, {"flipSubp", 1}};
  EXPECT_EQ(import_looking_glass(file.dump(), "classic").rig.panel.layout.name(), "rgb");
  file["flipImageX"] = 0;
  EXPECT_EQ(import_looking_glass(file.dump(), "classic").rig.panel.layout.name(), "bgr");
}

TEST(LookingGlassImport, AcceptsThePortraitSample) {
  const json file = {{"pitch", 52.59},  {"slope", -7.0835}, {"center", 0.5},    {"DPI", 324},
                     {"screenW", 1536}, {"screenH", 2048},  {"viewCone", 40.0}, {"flipSubp", 0}};
  const Rig rig = import_looking_glass(file.dump(), "portrait").rig;
  EXPECT_NEAR(3.0 * 1536 / rig.sheet.pitch.value, 246.87, 0.01);
  EXPECT_NEAR(rig.sheet.pitch.value, 18.66, 0.01);
  EXPECT_NEAR(rig.sheet.slant, 0.14117, 1e-5);
  EXPECT_NEAR(rig.sheet.gap.value, 0.67, 0.01);
  EXPECT_TRUE(std::isinf(rig.viewing.distance.value));
  bool says_effective = false;
  for (const auto& [key, text] : rig.provenance) {
    says_effective = says_effective || text == "effective, reference distance unknown";
  }
  EXPECT_TRUE(says_effective);
}

// --- Looking Glass, cells

double cell_view(const json& file, int i, int j, int channel) {
  const int y = static_cast<int>(number(file, "screenH")) - 1 - j;
  const json& cells = file.at("subpixelCells");
  const size_t index = test::looking_glass::cell_index(file.at("CellPatternMode").get<int>(), i, y);
  const json& cell = cells.at(index % cells.size());
  const auto of = [&cell](const char* key) { return cell.at(key).get<double>(); };
  return test::looking_glass::cell_view(numbers_of(file),
                                        {{{of("ROffsetX"), of("ROffsetY")},
                                          {of("GOffsetX"), of("GOffsetY")},
                                          {of("BOffsetX"), of("BOffsetY")}}},
                                        i, j, channel);
}

json random_cells(std::mt19937_64& random, size_t count) {
  json cells = json::array();
  for (size_t n = 0; n < count; ++n) {
    json cell;
    for (const char* key :
         {"ROffsetX", "ROffsetY", "GOffsetX", "GOffsetY", "BOffsetX", "BOffsetY"}) {
      cell[key] = uniform(random, -0.6, 0.6);
    }
    cells.push_back(cell);
  }
  return cells;
}

class CellPattern : public ::testing::TestWithParam<int> {};

TEST_P(CellPattern, GivesTheCellShadersViews) {
  std::mt19937_64 random(200 + static_cast<uint64_t>(GetParam()));
  for (int r = 0; r < 30; ++r) {
    json file = random_visual(random, r % 2 == 0);
    file["CellPatternMode"] = GetParam();
    file["subpixelCells"] = random_cells(random, r % 3 == 0 ? 1 : 4);
    const OpticalModel model(import_looking_glass(file.dump(), "visual.json").rig);
    const Panel& panel = model.rig().panel;
    for (int n = 0; n < 60; ++n) {
      const auto [i, j] = sample(random, n, panel.width_px, panel.height_px);
      for (int c = 0; c < 3; ++c) {
        // view / N = 1/2 - place
        ASSERT_LT(apart(0.5 - our_phase(model, i, j, c), cell_view(file, i, j, c)), 1e-6)
            << "pixel " << i << ", " << j << " channel " << c;
      }
    }
  }
}

TEST_P(CellPattern, SurvivesExportAndImport) {
  std::mt19937_64 random(300 + static_cast<uint64_t>(GetParam()));
  json file = random_visual(random, true);
  file["CellPatternMode"] = GetParam();
  file["subpixelCells"] = random_cells(random, 4);
  const LookingGlassImport first = import_looking_glass(file.dump(), "visual.json");
  const OpticalModel before(first.rig);
  const OpticalModel after(
      import_looking_glass(export_looking_glass(first.rig, first.views), "exported").rig);
  for (int n = 0; n < 400; ++n) {
    const auto [i, j] = sample(random, n, first.rig.panel.width_px, first.rig.panel.height_px);
    ASSERT_LT(apart(our_phase(before, i, j, n % 3), our_phase(after, i, j, n % 3)), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, CellPattern, ::testing::Range(0, 5));

TEST(LookingGlassImport, IsDeterministic) {
  std::mt19937_64 random(17);
  json file = random_visual(random, true);
  file["CellPatternMode"] = 3;
  file["subpixelCells"] = random_cells(random, 4);
  const std::string text = file.dump();
  const Rig first = import_looking_glass(text, "a").rig;
  EXPECT_EQ(first, import_looking_glass(text, "a").rig);
  EXPECT_EQ(fingerprint(first), fingerprint(import_looking_glass(text, "b").rig));
}

TEST(LookingGlassExport, KeepsThePhases) {
  std::mt19937_64 random(23);
  for (int r = 0; r < 40; ++r) {
    Rig rig = test::kiosk_rig();
    rig.panel.layout = SubpixelLayout::named(r % 2 == 0 ? "rgb" : "bgr");
    rig.sheet.slant = uniform(random, 0.05, 0.5) * (random() % 2 == 0 ? 1 : -1);
    rig.sheet.offset = Lenses(uniform(random, -1.0, 1.0));
    rig.sheet.refraction_shape = 1.0;
    rig.viewing.height = Millimetres(uniform(random, -80.0, 80.0));
    rig.viewing.centre = Millimetres(uniform(random, -80.0, 80.0));
    if (r % 4 == 0) rig.viewing = {};
    const OpticalModel model(rig);
    const json file = json::parse(export_looking_glass(rig));
    for (int n = 0; n < 60; ++n) {
      const auto [i, j] = sample(random, n, rig.panel.width_px, rig.panel.height_px);
      for (int c = 0; c < 3; ++c) {
        ASSERT_LT(apart(our_phase(model, i, j, c) + 0.5, classic_coordinate(file, i, j, c)), 1e-6);
      }
    }
  }
}

TEST(LookingGlassExport, RefusesRigsThatTheFormatCannotExpress) {
  const auto refused = [](Rig rig, const char* key) {
    try {
      (void)export_looking_glass(rig);
      return false;
    } catch (const Error& error) {
      return error.kind() == ErrorKind::Input &&
             std::string(error.what()).find(key) != std::string::npos;
    }
  };
  std::mt19937_64 random(1);
  Rig rig = test::kiosk_rig();
  rig.sheet.residual = test::random_residual(random, 3, 3, 0.1);
  EXPECT_TRUE(refused(rig, "sheet.residual"));
  rig = test::kiosk_rig();
  rig.sheet.channel_offset[0] = Subpixels(0.1);
  EXPECT_TRUE(refused(rig, "sheet.channel_offset_subpx"));
  EXPECT_TRUE(refused(test::upright_rig(), "sheet.slant"));
  rig = test::kiosk_rig();
  rig.panel.pixel_height = Millimetres(0.2);
  EXPECT_TRUE(refused(rig, "panel.pixel_height_mm"));
  rig = test::kiosk_rig();
  rig.panel.layout =
      SubpixelLayout::cells(3, 1, {PixelCell{}, PixelCell{{{0.1, 0.5}, {}, {}}}, PixelCell{}});
  EXPECT_TRUE(refused(rig, "panel.layout"));
}

// --- CubeVi

double cubevi_fraction(const json& file, int i, int j, int channel) {
  const double x = i + 1.0, y = j + 1.0;  // their pixel coordinates include a second half pixel
  const int c = file.value("pixel_order", "rgb") == "bgr" ? 2 - channel : channel;
  const double interval = file.at("interval").get<double>();
  return fract((3.0 * (x + y * file.at("slope").get<double>()) + c + file.at("x0").get<double>()) /
               interval);
}

TEST(CubeviImport, GivesTheShadersPhases) {
  std::mt19937_64 random(31);
  for (int r = 0; r < 100; ++r) {
    const json file = {{"slope", uniform(random, -0.5, 0.5)},
                       {"interval", uniform(random, 5.0, 25.0)},
                       {"x0", uniform(random, -20.0, 20.0)},
                       {"width", 1440},
                       {"height", 2560},
                       {"pixel_order", r % 2 == 0 ? "rgb" : "bgr"}};
    const OpticalModel model(import_cubevi(file.dump(), "deviceConfig.json"));
    EXPECT_TRUE(std::isinf(model.rig().viewing.distance.value));
    for (int n = 0; n < 60; ++n) {
      const auto [i, j] = sample(random, n, 1440, 2560);
      for (int c = 0; c < 3; ++c) {
        ASSERT_LT(apart(our_phase(model, i, j, c) + 0.5, cubevi_fraction(file, i, j, c)), 1e-6);
      }
    }
  }
}

TEST(CubeviImport, ReadsTheGridAsAResidualMap) {
  std::mt19937_64 random(37);
  json file = {
      {"slope", 0.2521}, {"interval", 7.701}, {"x0", 8.4}, {"width", 5120}, {"height", 2880}};
  const OpticalModel flat(import_cubevi(file.dump(), "flat"));
  for (int n = 0; n < 77; ++n) file["grid"].push_back(uniform(random, -0.58, 0.96));
  const OpticalModel bent(import_cubevi(file.dump(), "bent"));
  // Both kinds of interpolation give the knot's value at a knot.
  for (int row = 0; row < 7; ++row) {
    for (int column = 0; column < 11; ++column) {
      const double x = 512.0 * column, y = 480.0 * row;
      const double subpixels =
          7.701 * (bent.lens_coordinate(x, y, 1) - flat.lens_coordinate(x, y, 1));
      ASSERT_NEAR(subpixels, file["grid"].at(static_cast<size_t>(11 * row + column)).get<double>(),
                  1e-9);
    }
  }
}

TEST(CubeviImport, ReadsTheNestedForm) {
  const json file = {
      {"grating_params", {{"x0", 8.4}, {"interval", 7.701}, {"slope", 0.2521}, {"kx1", 43.0}}},
      {"width", 5120},
      {"height", 2880},
      {"pixel_mm", 0.1167}};
  const Rig rig = import_cubevi(file.dump(), "x0.json");
  EXPECT_EQ(rig.sheet.pitch.value, 7.701);
  EXPECT_NEAR(rig.sheet.gap.value, 43.0 * 0.1167 / 3.0, 1e-12);
}

TEST(CubeviExport, KeepsThePhases) {
  std::mt19937_64 random(41);
  Rig rig = test::kiosk_rig();
  rig.viewing = {};
  rig.sheet.refraction_shape = 1.0;
  rig.sheet.offset = Lenses(0.3);
  rig.sheet.residual = test::random_residual(random, 11, 7, 0.1);
  const OpticalModel before(rig), after(import_cubevi(export_cubevi(rig), "exported"));
  for (int n = 0; n < 500; ++n) {
    const auto [i, j] = sample(random, n, 3840, 2160);
    ASSERT_LT(apart(our_phase(before, i, j, n % 3), our_phase(after, i, j, n % 3)), 1e-9);
  }
}

}  // namespace
}  // namespace lenticule::optics
