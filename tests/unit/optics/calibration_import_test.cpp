// SPDX-License-Identifier: Apache-2.0
// Tests refused calibrations; tests/property/optics covers the meaning of the numbers.
#include "optics/calibration_import.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::optics {
namespace {

constexpr const char* kVisual = R"({"pitch": {"value": 52.59}, "slope": {"value": -7.08},
  "center": {"value": 0.5}, "DPI": {"value": 324}, "screenW": {"value": 1536},
  "screenH": {"value": 2048}, "invView": {"value": 1}})";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

template <class Import>
std::string complaint(const Import& import, const std::string& text) {
  try {
    (void)import(text, "a.json");
    return {};
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return error.what();
  }
}

std::string visual_complaint(const std::string& text) {
  return complaint(import_looking_glass, text);
}

TEST(VisualJson, IsAcceptedPlainOrWrapped) {
  EXPECT_EQ(visual_complaint(kVisual), "");
  EXPECT_EQ(visual_complaint(with(kVisual, "{\"value\": 52.59}", "52.59")), "");
}

TEST(VisualJson, NamesTheMissingKey) {
  for (const char* key : {"pitch", "slope", "center", "DPI", "screenW", "screenH"}) {
    const std::string quoted = std::string("\"") + key + "\"";
    EXPECT_EQ(visual_complaint(with(kVisual, quoted, "\"other\"")),
              std::string("a.json: ") + key + ": missing");
  }
}

TEST(VisualJson, RefusesAbsurdValues) {
  EXPECT_EQ(visual_complaint(with(kVisual, "-7.08", "0")), "a.json: slope: zero");
  EXPECT_EQ(visual_complaint(with(kVisual, "52.59", "-1")), "a.json: pitch: not greater than 0");
  EXPECT_EQ(visual_complaint(with(kVisual, "52.59", "\"x\"")), "a.json: pitch: not a number");
  EXPECT_EQ(visual_complaint(with(kVisual, "324", "0")), "a.json: DPI: not greater than 0");
  EXPECT_NE(visual_complaint(with(kVisual, "1536", "1e9")), "");
  EXPECT_NE(visual_complaint(with(kVisual, "1536", "1536.5")), "");
  EXPECT_NE(visual_complaint(with(kVisual, "52.59", "1e308")), "");
  EXPECT_NE(visual_complaint(with(kVisual, "52.59", "1e-300")), "");
  EXPECT_NE(visual_complaint(with(kVisual, "52.59", "1e999")), "");
}

TEST(VisualJson, RefusesBadCells) {
  const auto cells = [](const std::string& list, const std::string& mode) {
    return with(kVisual, "\"invView\"",
                "\"CellPatternMode\": " + mode + ", \"subpixelCells\": " + list + ", \"invView\"");
  };
  const std::string good =
      R"([{"ROffsetX":0,"ROffsetY":0,"GOffsetX":0,"GOffsetY":0,"BOffsetX":0,"BOffsetY":0}])";
  EXPECT_EQ(visual_complaint(cells(good, "0")), "");
  EXPECT_EQ(visual_complaint(cells("[]", "0")), "");  // no cells: stripes
  EXPECT_EQ(visual_complaint(cells(good, "5")), "a.json: CellPatternMode: not one of 0 to 4");
  EXPECT_EQ(visual_complaint(cells(good, "-1")), "a.json: CellPatternMode: not one of 0 to 4");
  EXPECT_NE(visual_complaint(cells("[1]", "0")), "");
  EXPECT_NE(visual_complaint(cells("{\"a\": 1}", "0")), "");
  EXPECT_NE(visual_complaint(cells(with(good, "\"GOffsetX\":0", "\"GOffsetX\":7"), "0")), "");
}

TEST(VisualJson, RefusesMirroredPictures) {
  const auto flipped = [](const std::string& more) {
    return visual_complaint(with(kVisual, R"("invView")", more + R"(, "invView")"));
  };
  EXPECT_EQ(flipped(R"("flipImageX": 1, "flipImageY": {"value": 0}, "flipSubp": 1)"), "");
  EXPECT_EQ(
      flipped(R"("flipImageY": {"value": 1})"),
      "a.json: flipImageY: pictures mirrored top to bottom, which a rig file cannot describe");
  const std::string cells =
      R"("subpixelCells": [{"ROffsetX": -0.3, "ROffsetY": 0, "GOffsetX": 0, "GOffsetY": 0,
         "BOffsetX": 0.3, "BOffsetY": 0}])";
  EXPECT_EQ(flipped(cells), "");
  EXPECT_EQ(flipped(cells + R"(, "flipSubp": 1)"),
            "");  // the cells state the places of red and blue
}

TEST(VisualJson, RefusesInvalidJson) {
  for (const char* text : {"", "[", "[]", "3", "\"x\"", "{\"pitch\":", "\xFF\xFE"}) {
    EXPECT_EQ(visual_complaint(text).rfind("a.json: ", 0), 0u) << text;
  }
  EXPECT_EQ(visual_complaint(std::string(100000, '[')).rfind("a.json: ", 0), 0u);
}

TEST(Cubevi, RefusesAbsurdValues) {
  const std::string good =
      R"({"slope": 0.1, "interval": 19.6, "x0": 15.4, "width": 1440, "height": 2560})";
  const auto cubevi_complaint = [](const std::string& text) {
    return complaint(import_cubevi, text);
  };
  EXPECT_EQ(cubevi_complaint(good), "");
  EXPECT_EQ(cubevi_complaint(with(good, "19.6", "0")), "a.json: interval: not greater than 0");
  EXPECT_EQ(cubevi_complaint(with(good, "\"x0\"", "\"y0\"")), "a.json: x0: missing");
  EXPECT_NE(cubevi_complaint(with(good, "\"x0\"", "\"grid\": [1, 2], \"x0\"")), "");
  EXPECT_NE(cubevi_complaint(with(good, "\"x0\"", "\"pixel_order\": \"vrgb\", \"x0\"")), "");
  EXPECT_NE(cubevi_complaint(with(good, "1440", "-5")), "");
  EXPECT_NE(cubevi_complaint(with(good, "\"slope\"", "\"grating_params\": 3, \"slope\"")), "");
}

}  // namespace
}  // namespace lenticule::optics
