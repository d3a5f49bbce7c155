// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/film_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "player/sources/source_spec.h"

namespace lenticule::tools {
namespace {

render::Canvas canvas_of_wall(const optics::PlacedWall& wall, Interval x_mm, Interval y_mm) {
  render::Canvas canvas{.width_mm = x_mm.width(),
                        .height_mm = y_mm.width(),
                        .depth_of_field_mm = std::numeric_limits<double>::infinity(),
                        .viewing_distance_mm = wall.viewer_mm.z};
  for (const optics::PlacedPanel& panel : wall.panels)
    canvas.depth_of_field_mm = std::min(
        canvas.depth_of_field_mm, optics::OpticalModel(panel.trimmed.rig).depth_of_field_mm());
  return canvas;
}

}  // namespace

FilmPanel panel_of_rig(const std::string& rig_file) {
  optics::TrimmedRig trimmed = optics::load_rig_and_identity(rig_file);
  const render::Canvas canvas = render::canvas_of(optics::OpticalModel(trimmed.rig));
  return {.trimmed = std::move(trimmed), .canvas = canvas};
}

FilmPanel panel_of_wall(const optics::PlacedWall& wall, const optics::PlacedPanel& panel) {
  Interval x_mm, y_mm;
  for (const optics::PlacedPanel& each : wall.panels) {
    x_mm.extend(each.x_mm);
    y_mm.extend(each.y_mm);
  }
  FilmPanel out{.trimmed = panel.trimmed,
                .canvas = canvas_of_wall(wall, x_mm, y_mm),
                .name = panel.name,
                .canvas_from_panel = panel.wall_from_panel};
  const Vec3 middle{(x_mm.low + x_mm.high) / 2.0, (y_mm.low + y_mm.high) / 2.0, 0.0};
  out.canvas_from_panel.origin = panel.wall_from_panel.origin - middle;
  return out;
}

FilmPanel panel_of_rig_or_wall(const std::string& rig_file, const std::string& wall_file,
                               const std::string& panel) {
  if (wall_file.empty()) return panel_of_rig(rig_file);
  if (panel.empty())
    throw Error(ErrorKind::Usage, fmt::format("--wall {}: a film is for one panel", wall_file),
                "choose one with --panel NAME; each panel has a film of its own");
  const optics::PlacedWall wall = optics::load_wall(wall_file);
  return panel_of_wall(wall, wall.panel(panel));
}

std::string target_of_panel(const std::string& target, const std::string& panel) {
  if (player::parse_source(target).kind == player::SourceKind::Ring)
    throw Error(ErrorKind::Usage, fmt::format("-o {}: a wall has a frame per panel", target),
                "choose one with --panel NAME");
  return optics::file_of_panel(target, panel);
}

}  // namespace lenticule::tools
