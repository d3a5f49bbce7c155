// SPDX-License-Identifier: Apache-2.0
#include "optics/wall/wall.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error_kinds.h"
#include "base/file.h"
#include "optics/rig_file.h"
#include "optics/toml.h"
#include "optics/units.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 1u << 20;

Affine rotation(double degrees, Vec3 axis) {
  const double angle = radians_from_degrees(degrees).value;
  const double c = std::cos(angle), s = std::sin(angle);
  if (axis.x != 0.0) return {{1, 0, 0}, {0, c, s}, {0, -s, c}, {}};
  if (axis.y != 0.0) return {{c, 0, -s}, {0, 1, 0}, {s, 0, c}, {}};
  return {{c, s, 0}, {-s, c, 0}, {0, 0, 1}, {}};
}

/// Returns the viewing line of a panel on which the viewer of the wall stands.
ViewingLine viewing_line(Vec3 viewer_mm, const Affine& wall_from_panel) {
  const Vec3 from_panel = viewer_mm - wall_from_panel.origin;
  return {.height = Millimetres(dot(wall_from_panel.column_y, from_panel)),
          .distance = Millimetres(dot(wall_from_panel.column_z, from_panel)),
          .centre = Millimetres(dot(wall_from_panel.column_x, from_panel))};
}

void extend(const Panel& panel, PlacedPanel& placed) {
  const double half_width = panel.width_px * panel.pixel_width.value / 2.0;
  const double half_height = panel.height_px * panel.pixel_height.value / 2.0;
  for (const double x : {-half_width, half_width})
    for (const double y : {-half_height, half_height}) {
      const Vec3 corner = placed.wall_from_panel.point({x, y, 0.0});
      placed.x_mm.extend(corner.x);
      placed.y_mm.extend(corner.y);
    }
}

PlacedPanel place(const WallPanel& panel, Vec3 viewer_mm, const std::filesystem::path& wall_file) {
  const std::filesystem::path rig_file = wall_file.parent_path() / panel.rig;
  PlacedPanel placed{.name = panel.name,
                     .output = panel.output,
                     .calibrated = load_rig(rig_file),
                     .trim = load_trim(rig_file),
                     .trimmed = {},
                     .wall_from_panel = wall_from_panel(panel),
                     .x_mm = {},
                     .y_mm = {}};
  placed.calibrated.viewing = viewing_line(viewer_mm, placed.wall_from_panel);
  const std::string context = fmt::format("{}: panel '{}'", wall_file.string(), panel.name);
  if (!(placed.calibrated.viewing.distance.value > 0.0))
    throw input_error("{}: the viewer stands behind it", context)
        .remedy("check viewer_mm, centre_mm and turn_degrees; z grows toward the viewer");
  placed.trimmed = {trimmed(placed.calibrated, placed.trim),
                    identity_of(placed.calibrated, placed.trim)};
  validate_rig(placed.calibrated, context);
  validate_rig(placed.trimmed.rig, context);
  extend(placed.calibrated.panel, placed);
  return placed;
}

constexpr size_t kMaxNameBytes = 32;
constexpr size_t kMaxPathBytes = 1024;

bool is_name(std::string_view text) {
  constexpr std::string_view kLetters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
  return !text.empty() && text.size() <= kMaxNameBytes && text.front() != '-' &&
         text.find_first_not_of(kLetters) == std::string_view::npos;
}

bool is_path(std::string_view text) {
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
  return !text.empty() && text.size() <= kMaxPathBytes && std::ranges::none_of(text, is_control);
}

Vec3 read_point(const TomlSection& section, std::string_view key) {
  const toml::array& list = section.array(key);
  if (list.size() != 3)
    section.fail(list, fmt::format("'{}' is not [x, y, z]", section.full_name(key)));
  std::vector<double> v = section.numbers(list, key);
  for (const double value : v) section.require_within(list, value, key, -kMaxWallMm, kMaxWallMm);
  return {v[0], v[1], v[2]};
}

double read_angle(const TomlSection& panel, std::string_view key, double most) {
  return panel.find(key) != nullptr ? panel.number_within(key, -most, most) : 0.0;
}

std::string read_name(const TomlSection& panel, const std::vector<WallPanel>& before) {
  const toml::node& node = panel.get("name");
  std::string name = panel.text_of(node, "name");
  if (!is_name(name))
    panel.fail(node, "'panel.name' is not one to 32 letters, digits, '-' and '_'",
               "it becomes a part of file names: name = \"left\"");
  if (std::ranges::find(before, name, &WallPanel::name) != before.end())
    panel.fail(node, fmt::format("two panels are named '{}'", name));
  return name;
}

std::string read_rig_path(const TomlSection& panel) {
  const toml::node& node = panel.get("rig");
  std::string path = panel.text_of(node, "rig");
  if (!is_path(path))
    panel.fail(node, "'panel.rig' is not the name of a file", "for example rig = \"left.toml\"");
  return path;
}

std::string read_output(const TomlSection& panel) {
  const toml::node* const node = panel.find("output");
  if (node == nullptr) return {};
  std::string output = panel.text_of(*node, "output");
  if (!is_name(output))
    panel.fail(*node, "'panel.output' is not the name of a connector",
               "'lenticule panels' lists them: output = \"DP-1\"");
  return output;
}

WallPanel read_panel(const TomlSection& panel, const std::vector<WallPanel>& before) {
  panel.allow_only(
      {"name", "rig", "output", "centre_mm", "turn_degrees", "tilt_degrees", "roll_degrees"});
  return {.name = read_name(panel, before),
          .rig = read_rig_path(panel),
          .centre_mm = read_point(panel, "centre_mm"),
          .turn_degrees = read_angle(panel, "turn_degrees", kMaxFacingDegrees),
          .tilt_degrees = read_angle(panel, "tilt_degrees", kMaxFacingDegrees),
          .roll_degrees = read_angle(panel, "roll_degrees", kMaxRollDegrees),
          .output = read_output(panel)};
}

}  // namespace

Affine wall_from_panel(const WallPanel& panel) {
  Affine place =
      rotation(panel.turn_degrees, {0, 1, 0}) *
      (rotation(-panel.tilt_degrees, {1, 0, 0}) * rotation(panel.roll_degrees, {0, 0, 1}));
  place.origin = panel.centre_mm;
  return place;
}

std::string file_of_panel(const std::string& file, const std::string& panel) {
  const std::filesystem::path path(file);
  const std::string extension = path.has_extension() ? path.extension().string() : ".lts";
  return (path.parent_path() / fmt::format("{}-{}{}", path.stem().string(), panel, extension))
      .string();
}

const PlacedPanel& PlacedWall::panel(const std::string& name) const {
  const auto found = std::ranges::find(panels, name, &PlacedPanel::name);
  if (found != panels.end()) return *found;
  std::vector<std::string> names;
  for (const PlacedPanel& panel : panels) names.push_back(panel.name);
  throw usage_error("the wall has no panel '{}'", name)
      .remedy(fmt::format("its panels are: {}", fmt::join(names, ", ")));
}

PlacedWall load_wall(const std::filesystem::path& file) {
  const Wall wall = parse_wall(read_text_file(file, kMaxFileBytes), file.string());
  PlacedWall placed{.viewer_mm = wall.viewer_mm, .panels = {}};
  for (const WallPanel& panel : wall.panels)
    placed.panels.push_back(place(panel, wall.viewer_mm, file));
  return placed;
}

Wall parse_wall(std::string_view text, const std::string& source) {
  const toml::table table = parse_toml(text, source);
  const TomlSection root(table, {}, source);
  root.allow_only({"format", "viewer_mm", "panel"});
  root.require_format_1();
  Wall wall{.viewer_mm = read_point(root, "viewer_mm"), .panels = {}};
  const toml::node& list = root.get("panel");
  if (list.as_array() == nullptr || list.as_array()->empty())
    root.fail(list, "'panel' is not a list of panels", "each panel begins with [[panel]]");
  for (const toml::node& item : *list.as_array()) {
    if (item.as_table() == nullptr)
      root.fail(item, "'panel' is not a list of panels", "each panel begins with [[panel]]");
    if (wall.panels.size() == kMaxWallPanels)
      root.fail(item, fmt::format("more than {} panels", kMaxWallPanels));
    wall.panels.push_back(read_panel(TomlSection(*item.as_table(), "panel", source), wall.panels));
  }
  return wall;
}

}  // namespace lenticule::optics
