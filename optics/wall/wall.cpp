// SPDX-License-Identifier: Apache-2.0
#include "optics/wall/wall.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/file.h"
#include "optics/rig_file.h"
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
    throw Error(ErrorKind::Input, context + ": the viewer stands behind it",
                "check viewer_mm, centre_mm and turn_degrees; z grows toward the viewer");
  placed.trimmed = {trimmed(placed.calibrated, placed.trim),
                    identity_of(placed.calibrated, placed.trim)};
  validate_rig(placed.calibrated, context);
  validate_rig(placed.trimmed.rig, context);
  extend(placed.calibrated.panel, placed);
  return placed;
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
  throw Error(ErrorKind::Usage, fmt::format("the wall has no panel '{}'", name),
              fmt::format("its panels are: {}", fmt::join(names, ", ")));
}

PlacedWall load_wall(const std::filesystem::path& file) {
  const Wall wall = parse_wall(read_text_file(file, kMaxFileBytes), file.string());
  PlacedWall placed{.viewer_mm = wall.viewer_mm, .panels = {}};
  for (const WallPanel& panel : wall.panels)
    placed.panels.push_back(place(panel, wall.viewer_mm, file));
  return placed;
}

}  // namespace lenticule::optics
