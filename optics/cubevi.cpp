// SPDX-License-Identifier: Apache-2.0
// Reads and writes CubeVi-style calibrations: t = fract((3 (x + y slope) + c + x0 + grid) /
// interval) with x = i + 1, y = j + 1, y down and c counted from the left. In our terms 3 x + c = 3
// X + 5/2 and y = Y + 1/2; lambda = t - 1/2 up to whole lenses.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "optics/calibration_import.h"
#include "optics/effective_sheet.h"
#include "optics/json_fields.h"

namespace lenticule::optics {
namespace {

constexpr int kGridColumns = 11;
constexpr int kGridRows = 7;
constexpr double kAssumedPixelMm = 0.1;
constexpr double kAssumedConeDegrees = 40.0;

/// Returns the format's coordinate at the panel's centre, without x0, in subpixels.
double centre_subpixels(const Panel& panel, double slope) {
  return 1.5 * panel.width_px + 2.5 + 3.0 * slope * (panel.height_px / 2.0 + 0.5);
}

ResidualMap read_grid(const JsonFields& file, const nlohmann::json& grid, double interval) {
  ResidualMap map{.columns = kGridColumns, .rows = kGridRows, .lenses = {}};
  if (!grid.is_array() || grid.size() != kGridColumns * kGridRows) {
    file.fail("grid", "not a list of 11 x 7 values");
  }
  for (const nlohmann::json& value : grid) {
    if (!value.is_number()) file.fail("grid", "a value is not a number");
    map.lenses.push_back(value.get<double>() / interval);
  }
  return map;
}

/// Returns the object that holds the numbers: the file itself or its "grating_params".
const nlohmann::json& numbers_of(const nlohmann::json& document) {
  const auto nested = document.find("grating_params");
  return nested != document.end() ? *nested : document;
}

}  // namespace

Rig import_cubevi(std::string_view json, const std::string& source) {
  const nlohmann::json document = parse_json(json, source);
  const JsonFields file(document, source);
  const JsonFields values(numbers_of(document), source);
  const double interval = values.number("interval"), slope = values.number("slope");
  if (!(interval > 0.0)) values.fail("interval", "not greater than 0");

  Rig rig;
  rig.name = "CubeVi display";
  rig.panel.width_px = file.side("width");
  rig.panel.height_px = file.side("height");
  rig.panel.layout = SubpixelLayout::named(file.text_or("pixel_order", "rgb"));
  if (rig.panel.layout.name() != "rgb" && rig.panel.layout.name() != "bgr") {
    file.fail("pixel_order", "not rgb or bgr");
  }
  const bool knows_size = file.find("pixel_mm") != nullptr;
  rig.panel.pixel_width = rig.panel.pixel_height =
      Millimetres(file.number_or("pixel_mm", kAssumedPixelMm));

  rig.sheet.pitch = Subpixels(interval);
  rig.sheet.slant = slope;
  rig.sheet.offset = Lenses(without_whole_lenses(
      (centre_subpixels(rig.panel, slope) + values.number("x0")) / interval - 0.5));
  const double gap_subpx = values.number_or(
      "kx1", interval / (2.0 * std::tan(kAssumedConeDegrees * std::numbers::pi / 360.0)));
  rig.sheet.gap = Millimetres(gap_subpx * rig.panel.pixel_width.value / 3.0);
  if (const nlohmann::json* grid = file.find("grid")) {
    rig.sheet.residual = read_grid(file, *grid, interval);
  }
  rig.provenance = {{"source", foreign_text(source)},
                    {"imported_from", "CubeVi values"},
                    {"pitch", "effective, reference distance unknown"}};
  if (!knows_size) rig.provenance.emplace_back("pixel_size", "assumed, not in the file");
  validate_rig(rig, source);
  return rig;
}

std::string export_cubevi(const Rig& rig) {
  const auto refuse = [](const char* key, const char* cause) {
    throw Error(ErrorKind::Input, fmt::format("CubeVi values: {}: {}", key, cause),
                "the format cannot store it");
  };
  const Panel& panel = rig.panel;
  if (!panel.mounting.upright()) refuse("panel.mounting", "a picture that is turned after weaving");
  if (panel.layout.name() != "rgb" && panel.layout.name() != "bgr") {
    refuse("panel.layout", "neither rgb nor bgr");
  }
  if (panel.pixel_width.value != panel.pixel_height.value) {
    refuse("panel.pixel_height_mm", "pixels that are not square");
  }
  for (const Subpixels offset : rig.sheet.channel_offset) {
    if (offset.value != 0.0) refuse("sheet.channel_offset_subpx", "offsets per channel");
  }
  const ResidualMap& residual = rig.sheet.residual;
  if (!residual.empty() && (residual.columns != kGridColumns || residual.rows != kGridRows)) {
    refuse("sheet.residual", "a residual map that is not 11 x 7");
  }
  const EffectiveSheet sheet = effective_sheet(rig);
  const double interval = sheet.pitch.value;
  const double x0 = without_whole_lenses(sheet.offset.value + 0.5 -
                                         centre_subpixels(panel, rig.sheet.slant) / interval) *
                    interval;
  nlohmann::json out = {{"slope", rig.sheet.slant},
                        {"interval", interval},
                        {"x0", x0},
                        {"kx1", 3.0 * rig.sheet.gap.value / panel.pixel_width.value},
                        {"width", panel.width_px},
                        {"height", panel.height_px},
                        {"pixel_mm", panel.pixel_width.value},
                        {"pixel_order", panel.layout.name()}};
  for (const double lenses : residual.lenses) out["grid"].push_back(lenses * interval);
  return out.dump(2) + "\n";
}

}  // namespace lenticule::optics
