// SPDX-License-Identifier: Apache-2.0
// Imports and exports foreign calibrations: Looking Glass visual.json (classic and cell panels) and
// CubeVi-style values. Their pitch has no distance term: an imported rig has an infinite viewing
// distance and says "effective, reference distance unknown" in its provenance.
//
// Reads and writes Looking Glass visual.json. With Pl lenses over the panel's width, s = 1 (-1 with
// flipImageX) and c = 0, 1, 2 for R, G, B (2, 1, 0 with flipSubp), a stripe's lens coordinate in
// that format is
//   z_c = (Pl / W) (i + 1/2 + s c/3 + s (H - Y) / slope) - center.
// So one stripe lies on the pixel's centre, and all stripes lie a third of a pixel to the right of
// ours, or with flipImageX a third to the left, in reverse order.
// Cells state their offsets from the pixel's centre instead, v upward. lambda = z - 1/2.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>

#include "base/error_kinds.h"
#include "optics/json_fields.h"
#include "optics/rig.h"

namespace lenticule::optics {

/// LookingGlassViews holds the values of a visual.json that describe views and have no counterpart
/// in our lens sheet.
struct LookingGlassViews {
  /// Angle of one viewing zone; 0 in an export = computed from the rig's gap.
  double view_cone_degrees = 0.0;
  /// invView of the file. If true, the view fraction is 1 - fract(z), which is 1/2 - place in our
  /// terms. If false, or on panels without cells, the view fraction is fract(z), which is 1/2 +
  /// place. Real devices have invView set.
  bool inverted = true;
};

struct LookingGlassImport {
  Rig rig;
  LookingGlassViews views;
};

inline constexpr double kMmPerInch = 25.4;
inline constexpr double kUsualConeDegrees = 40.0;
inline constexpr double kMaxCellOffsetPx = 1.5;
inline constexpr double kStripeBiasPx = 1.0 / 3.0;

/// CellIndexing maps a pixel to the index of its cell; x from the left, y from the bottom.
struct CellIndexing {
  int columns;
  int rows;
  int cells;
  int (*index)(int x, int y);
};
inline constexpr std::array<CellIndexing, 5> kCellIndexings{{
    {1, 1, 1, [](int, int) { return 0; }},
    {2, 2, 2, [](int x, int y) { return (x + y) % 2; }},
    {2, 1, 2, [](int x, int) { return x % 2; }},
    {2, 4, 4, [](int x, int y) { return (y + 2 * (x % 2)) % 4; }},
    {1, 2, 2, [](int, int y) { return y % 2; }},
}};

inline SubpixelOffset cell_offset(const JsonFields& cell, const std::string& channel) {
  const auto offset = [&](const std::string& key) {
    const double pixels = cell.number(key);
    if (!(std::abs(pixels) <= kMaxCellOffsetPx)) cell.fail(key, "more than a pixel and a half");
    return pixels;
  };
  return {0.5 + offset(channel + "OffsetX"), 0.5 - offset(channel + "OffsetY")};
}

inline std::vector<PixelCell> read_cells(const nlohmann::json& list, const std::string& source) {
  if (!list.is_array() || list.empty() || list.size() > 64)
    throw input_error("{}: subpixelCells: not a list of 1 to 64 cells", source);
  std::vector<PixelCell> cells;
  for (const nlohmann::json& item : list) {
    const JsonFields cell(item, source + ": subpixelCells");
    cells.push_back({cell_offset(cell, "R"), cell_offset(cell, "G"), cell_offset(cell, "B")});
  }
  return cells;
}

inline SubpixelLayout cell_layout(const JsonFields& file, const nlohmann::json& list,
                                  int height_px) {
  const std::vector<PixelCell> cells = read_cells(list, file.source());
  const double mode = file.number_or("CellPatternMode", file.number_or("cellPatternMode", 0.0));
  if (!(mode >= 0.0 && mode < static_cast<double>(kCellIndexings.size()) &&
        mode == std::floor(mode)))
    file.fail("CellPatternMode", "not one of 0 to 4");
  const CellIndexing& pattern = kCellIndexings[static_cast<size_t>(mode)];
  std::vector<PixelCell> table;
  for (int j = 0; j < pattern.rows; ++j) {
    // y is any row counted from the bottom that equals row j from the top, modulo the pattern's
    // period.
    const int y = (height_px - 1 - j) % pattern.rows + pattern.rows;
    for (int i = 0; i < pattern.columns; ++i)
      table.push_back(cells[static_cast<size_t>(pattern.index(i, y)) % cells.size()]);
  }
  return SubpixelLayout::cells(pattern.columns, pattern.rows, std::move(table));
}

/// Returns the difference between z and lambda at the panel's centre, without `center`.
inline double centre_coordinate(const Panel& panel, double lenses_per_px, double slope,
                                double bias_px) {
  return lenses_per_px * (panel.width_px / 2.0 + bias_px + panel.height_px / 2.0 / slope);
}

inline double gap_for_cone(double pitch_mm, double cone_degrees) {
  return pitch_mm / (2.0 * std::tan(cone_degrees * std::numbers::pi / 360.0));
}

/// Returns the cell list of a pattern that gives this layout on a panel of this height, if there is
/// one.
inline std::optional<std::vector<PixelCell>> cells_in_pattern(const SubpixelLayout& layout,
                                                              const CellIndexing& pattern,
                                                              int height_px) {
  std::vector<std::optional<PixelCell>> cells(static_cast<size_t>(pattern.cells));
  const int columns = std::lcm(layout.columns(), pattern.columns);
  const int rows = std::lcm(layout.rows(), pattern.rows);
  for (int j = 0; j < rows; ++j) {
    const int y = ((height_px - 1 - j) % pattern.rows + pattern.rows) % pattern.rows;
    for (int i = 0; i < columns; ++i) {
      const PixelCell here{layout.offset(i, j, 0), layout.offset(i, j, 1), layout.offset(i, j, 2)};
      std::optional<PixelCell>& cell = cells[static_cast<size_t>(pattern.index(i, y))];
      if (cell && *cell != here) return {};
      cell = here;
    }
  }
  std::vector<PixelCell> out;
  for (const std::optional<PixelCell>& cell : cells) out.push_back(cell.value());
  return out;
}

inline nlohmann::json cell_json(const PixelCell& cell) {
  return {{"ROffsetX", cell[0].x_px - 0.5}, {"ROffsetY", 0.5 - cell[0].y_px},
          {"GOffsetX", cell[1].x_px - 0.5}, {"GOffsetY", 0.5 - cell[1].y_px},
          {"BOffsetX", cell[2].x_px - 0.5}, {"BOffsetY", 0.5 - cell[2].y_px}};
}

inline void add_cells(const Panel& panel, nlohmann::json& out) {
  for (size_t mode = 0; mode < kCellIndexings.size(); ++mode) {
    const auto cells = cells_in_pattern(panel.layout, kCellIndexings[mode], panel.height_px);
    if (!cells) continue;
    out["CellPatternMode"] = {{"value", mode}};
    out["subpixelCells"] = nlohmann::json::array();
    for (const PixelCell& cell : *cells) out["subpixelCells"].push_back(cell_json(cell));
    return;
  }
  throw Error(ErrorKind::Input,
              "visual.json: panel.layout: a cell table that matches no known pattern",
              "the format has five patterns of up to four cells");
}

inline void refuse_what_cannot_be_said(const Rig& rig) {
  const auto refuse = [](const char* key, const char* cause) {
    throw input_error("visual.json: {}: {}", key, cause).remedy("the format cannot store it");
  };
  if (!rig.panel.mounting.upright())
    refuse("panel.mounting", "a picture that is turned after weaving");
  if (!rig.sheet.residual.empty()) refuse("sheet.residual", "a residual map");
  for (const Subpixels offset : rig.sheet.channel_offset)
    if (offset.value != 0.0) refuse("sheet.channel_offset_subpx", "offsets per channel");
  if (rig.sheet.slant == 0.0) refuse("sheet.slant", "upright lenses");
  if (rig.panel.pixel_width.value != rig.panel.pixel_height.value)
    refuse("panel.pixel_height_mm", "pixels that are not square");
}

/// Refuses values that a rig cannot express: a rig says where light goes, not that pictures are
/// mirrored.
inline void refuse_what_rigs_cannot_say(const JsonFields& file) {
  if (file.flag("flipImageY"))
    file.fail("flipImageY", "pictures mirrored top to bottom, which a rig file cannot describe");
}

/// Imports a visual.json. Values may be plain or wrapped as {"value": x}. The rig's gap is chosen
/// so that a lobe is as wide as viewCone (40 degrees if the file has none). Throws Error(Input)
/// with "source:" and the key.
[[nodiscard]] inline LookingGlassImport import_looking_glass(std::string_view json,
                                                             const std::string& source) {
  const nlohmann::json document = parse_json(json, source);
  const JsonFields file(document, source);
  const double pitch = file.number("pitch"), slope = file.number("slope");
  const double dpi = file.number("DPI"), center = file.number("center");
  if (slope == 0.0) file.fail("slope", "zero");
  if (!(pitch > 0.0)) file.fail("pitch", "not greater than 0");
  if (!(dpi > 0.0)) file.fail("DPI", "not greater than 0");

  Rig rig;
  rig.name = "Looking Glass " + foreign_text(file.text_or("serial", "display"));
  rig.panel.width_px = file.count("screenW", kMaxPanelPixels);
  rig.panel.height_px = file.count("screenH", kMaxPanelPixels);
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(kMmPerInch / dpi);
  const nlohmann::json* cells = file.find("subpixelCells");
  const bool has_cells = cells != nullptr && !cells->empty();
  refuse_what_rigs_cannot_say(file);
  const bool flipped = file.flag("flipImageX");
  const bool reversed = flipped != file.flag("flipSubp");
  // Cells give the positions of red and blue themselves, so the flips do not apply to them.
  rig.panel.layout = has_cells ? cell_layout(file, *cells, rig.panel.height_px)
                               : SubpixelLayout::named(reversed ? "bgr" : "rgb");

  const double tilt_slope = flipped ? -slope : slope;
  const double stripe_bias_px = flipped ? -kStripeBiasPx : kStripeBiasPx;
  const double lenses_across = pitch * rig.panel.width_px / dpi * std::cos(std::atan(1.0 / slope));
  const double lenses_per_px = lenses_across / rig.panel.width_px;
  rig.sheet.pitch = Subpixels(3.0 / lenses_per_px);
  rig.sheet.slant = -1.0 / tilt_slope;
  rig.sheet.offset = Lenses(without_whole_lenses(
      centre_coordinate(rig.panel, lenses_per_px, tilt_slope, has_cells ? 0.0 : stripe_bias_px) -
      center - 0.5));

  double cone = file.number_or("viewCone", kUsualConeDegrees);
  if (!(cone > 0.0 && cone < 170.0)) cone = kUsualConeDegrees;
  rig.sheet.gap =
      Millimetres(gap_for_cone(rig.sheet.pitch.value * rig.panel.pixel_width.value / 3.0, cone));
  rig.provenance = {{"source", foreign_text(source)},
                    {"imported_from", "Looking Glass visual.json"},
                    {"pitch", "effective, reference distance unknown"}};
  validate_rig(rig, source);
  return {.rig = std::move(rig),
          .views = {.view_cone_degrees = cone, .inverted = has_cells || file.flag("invView")}};
}

/// Exports `rig` as a visual.json. A finite viewing distance is folded into the effective pitch and
/// centre that the format requires; the result is exact for refraction_shape = 1, otherwise only
/// near the panel's centre. Throws Error(Input) that names the property of the rig that the format
/// cannot express (a residual map, per-channel offsets, m = 0, pixels that are not square, a cell
/// table of another pattern).
[[nodiscard]] inline std::string export_looking_glass(const Rig& rig,
                                                      const LookingGlassViews& views = {}) {
  refuse_what_cannot_be_said(rig);
  const Panel& panel = rig.panel;
  const EffectiveSheet sheet = effective_sheet(rig);
  const bool has_cells = panel.layout.name() != "rgb" && panel.layout.name() != "bgr";
  const double slope = -1.0 / rig.sheet.slant;
  const double lenses_per_px = 3.0 / sheet.pitch.value;
  const double dpi = kMmPerInch / panel.pixel_width.value;
  const double center =
      centre_coordinate(panel, lenses_per_px, slope, has_cells ? 0.0 : kStripeBiasPx) -
      sheet.offset.value - 0.5;
  const double half_lobe =
      std::atan(rig.sheet.pitch.value * panel.pixel_width.value / 6.0 / rig.sheet.gap.value);
  const double cone = views.view_cone_degrees > 0.0 ? views.view_cone_degrees
                                                    : half_lobe * 360.0 / std::numbers::pi;

  const auto wrapped = [](double value) { return nlohmann::json{{"value", value}}; };
  nlohmann::json out = {{"configVersion", "1.0"},
                        {"serial", foreign_text(rig.name)},
                        {"pitch", wrapped(lenses_per_px * dpi / std::cos(std::atan(1.0 / slope)))},
                        {"slope", wrapped(slope)},
                        {"center", wrapped(without_whole_lenses(center))},
                        {"viewCone", wrapped(cone)},
                        {"invView", wrapped(views.inverted ? 1.0 : 0.0)},
                        {"verticalAngle", wrapped(0.0)},
                        {"DPI", wrapped(dpi)},
                        {"screenW", wrapped(panel.width_px)},
                        {"screenH", wrapped(panel.height_px)},
                        {"flipImageX", wrapped(0.0)},
                        {"flipImageY", wrapped(0.0)},
                        {"flipSubp", wrapped(panel.layout.name() == "bgr" ? 1.0 : 0.0)}};
  if (has_cells) add_cells(panel, out);
  return out.dump(2) + "\n";
}

// Reads and writes CubeVi-style calibrations: t = fract((3 (x + y slope) + c + x0 + grid) /
// interval) with x = i + 1, y = j + 1, y down and c counted from the left. In our terms 3 x + c = 3
// X + 5/2 and y = Y + 1/2; lambda = t - 1/2 up to whole lenses.

inline constexpr int kGridColumns = 11;
inline constexpr int kGridRows = 7;
inline constexpr double kAssumedPixelMm = 0.1;
inline constexpr double kAssumedConeDegrees = 40.0;

/// Returns the format's coordinate at the panel's centre, without x0, in subpixels.
inline double centre_subpixels(const Panel& panel, double slope) {
  return 1.5 * panel.width_px + 2.5 + 3.0 * slope * (panel.height_px / 2.0 + 0.5);
}

inline ResidualMap read_grid(const JsonFields& file, const nlohmann::json& grid, double interval) {
  ResidualMap map{.columns = kGridColumns, .rows = kGridRows, .lenses = {}};
  if (!grid.is_array() || grid.size() != kGridColumns * kGridRows)
    file.fail("grid", "not a list of 11 x 7 values");
  for (const nlohmann::json& value : grid) {
    if (!value.is_number()) file.fail("grid", "a value is not a number");
    map.lenses.push_back(value.get<double>() / interval);
  }
  return map;
}

/// Returns the object that holds the numbers: the file itself or its "grating_params".
inline const nlohmann::json& cubevi_numbers(const nlohmann::json& document) {
  const auto nested = document.find("grating_params");
  return nested != document.end() ? *nested : document;
}

/// Imports {"slope", "interval", "x0", "width", "height", optional "pixel_order" ("rgb", "bgr"),
/// "grid" (11 x 7 values in subpixels from the top left), "pixel_mm", "kx1" (gap in subpixels)}, at
/// the top level or in "grating_params". The view fraction t of that system is 1/2 + place. Throws
/// Error(Input) with "source:" and the key.
[[nodiscard]] inline Rig import_cubevi(std::string_view json, const std::string& source) {
  const nlohmann::json document = parse_json(json, source);
  const JsonFields file(document, source);
  const JsonFields values(cubevi_numbers(document), source);
  const double interval = values.number("interval"), slope = values.number("slope");
  if (!(interval > 0.0)) values.fail("interval", "not greater than 0");

  Rig rig;
  rig.name = "CubeVi display";
  rig.panel.width_px = file.count("width", kMaxPanelPixels);
  rig.panel.height_px = file.count("height", kMaxPanelPixels);
  rig.panel.layout = SubpixelLayout::named(file.text_or("pixel_order", "rgb"));
  if (rig.panel.layout.name() != "rgb" && rig.panel.layout.name() != "bgr")
    file.fail("pixel_order", "not rgb or bgr");
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
  if (const nlohmann::json* grid = file.find("grid"))
    rig.sheet.residual = read_grid(file, *grid, interval);
  rig.provenance = {{"source", foreign_text(source)},
                    {"imported_from", "CubeVi values"},
                    {"pitch", "effective, reference distance unknown"}};
  if (!knows_size) rig.provenance.emplace_back("pixel_size", "assumed, not in the file");
  validate_rig(rig, source);
  return rig;
}

/// Exports `rig` in the same way as export_looking_glass(). The format can express m = 0 and any 11
/// x 7 residual map, but not cells.
[[nodiscard]] inline std::string export_cubevi(const Rig& rig) {
  const auto refuse = [](const char* key, const char* cause) {
    throw input_error("CubeVi values: {}: {}", key, cause).remedy("the format cannot store it");
  };
  const Panel& panel = rig.panel;
  if (!panel.mounting.upright()) refuse("panel.mounting", "a picture that is turned after weaving");
  if (panel.layout.name() != "rgb" && panel.layout.name() != "bgr")
    refuse("panel.layout", "neither rgb nor bgr");
  if (panel.pixel_width.value != panel.pixel_height.value)
    refuse("panel.pixel_height_mm", "pixels that are not square");
  for (const Subpixels offset : rig.sheet.channel_offset)
    if (offset.value != 0.0) refuse("sheet.channel_offset_subpx", "offsets per channel");
  const ResidualMap& residual = rig.sheet.residual;
  if (!residual.empty() && (residual.columns != kGridColumns || residual.rows != kGridRows))
    refuse("sheet.residual", "a residual map that is not 11 x 7");
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
