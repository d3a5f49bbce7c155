// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/commands/rig_wall.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <vector>

#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "optics/rig_store.h"
#include "optics/units.h"
#include "optics/wall/wall.h"

namespace lenticule::tools {
namespace {

using nlohmann::json;
using optics::PlacedPanel;
using optics::PlacedWall;

double width_mm(const PlacedPanel& placed) {
  const optics::Panel& panel = placed.calibrated.panel;
  return panel.width_px * panel.pixel_width.value;
}

double height_mm(const PlacedPanel& placed) {
  const optics::Panel& panel = placed.calibrated.panel;
  return panel.height_px * panel.pixel_height.value;
}

/// Returns the angle between the panel's normal and the direction to the viewer.
double viewer_degrees(const PlacedPanel& placed) {
  const optics::ViewingLine& line = placed.calibrated.viewing;
  return degrees_from_radians(
      Radians(std::atan2(std::hypot(line.centre.value, line.height.value), line.distance.value)));
}

/// Returns the distance of two intervals; negative if they overlap.
double distance(const Interval& a, const Interval& b) {
  return std::max(a.low, b.low) - std::min(a.high, b.high);
}

/// Gap is the gap between two neighbours, as the viewer sees them.
struct Gap {
  std::string first, second;
  bool beside = true;  ///< else one above the other
  double gap_mm = 0.0;
};

/// Returns the gaps of panels that overlap in height or in width, and are nearer to each other than
/// another panel between them would allow.
std::vector<Gap> gaps_of(const PlacedWall& wall) {
  std::vector<Gap> gaps;
  for (size_t a = 0; a < wall.panels.size(); ++a)
    for (size_t b = a + 1; b < wall.panels.size(); ++b) {
      const PlacedPanel &one = wall.panels[a], &other = wall.panels[b];
      const double x = distance(one.x_mm, other.x_mm), y = distance(one.y_mm, other.y_mm);
      const bool beside = x > y;
      const double smaller = beside ? std::min(one.x_mm.width(), other.x_mm.width())
                                    : std::min(one.y_mm.width(), other.y_mm.width());
      if (std::min(x, y) < 0.0 && std::max(x, y) < smaller)
        gaps.push_back({one.name, other.name, beside, std::max(x, y)});
    }
  return gaps;
}

json wall_json(const PlacedWall& wall) {
  json panels = json::array(), gaps = json::array();
  for (const PlacedPanel& placed : wall.panels) {
    const Vec3 centre = placed.wall_from_panel.origin;
    const optics::ViewingLine& line = placed.calibrated.viewing;
    panels.push_back({{"name", placed.name},
                      {"width_px", placed.calibrated.panel.width_px},
                      {"height_px", placed.calibrated.panel.height_px},
                      {"width_mm", width_mm(placed)},
                      {"height_mm", height_mm(placed)},
                      {"centre_mm", {centre.x, centre.y, centre.z}},
                      {"viewer_mm", {line.centre.value, line.height.value, line.distance.value}},
                      {"viewer_degrees", viewer_degrees(placed)},
                      {"fingerprint", placed.trimmed.identity.fingerprint}});
  }
  for (const Gap& gap : gaps_of(wall))
    gaps.push_back(
        {{"panels", {gap.first, gap.second}}, {"beside", gap.beside}, {"gap_mm", gap.gap_mm}});
  return {{"panels", panels}, {"gaps", gaps}};
}

void print_wall(const PlacedWall& wall) {
  for (const PlacedPanel& placed : wall.panels) {
    const optics::Panel& panel = placed.calibrated.panel;
    const Vec3 centre = placed.wall_from_panel.origin;
    print_out(
        "{}: {}x{} pixels, {:.1f} x {:.1f} mm, centre at {:.1f}, {:.1f}, {:.1f} mm, the viewer "
        "{:.1f} degrees off its normal\n",
        placed.name, panel.width_px, panel.height_px, width_mm(placed), height_mm(placed), centre.x,
        centre.y, centre.z, viewer_degrees(placed));
  }
  for (const Gap& gap : gaps_of(wall))
    print_out("{} and {}: {:.1f} mm {}, {}\n", gap.first, gap.second, std::abs(gap.gap_mm),
              gap.gap_mm < 0.0 ? "overlap" : "apart",
              gap.beside ? "side by side" : "one above the other");
}

/// Projection draws points of the wall's frame: x to the right, and y or -z upward.
struct Projection {
  double left_mm, top_mm;
  bool from_above;
  [[nodiscard]] std::string at(Vec3 p) const {
    return fmt::format("{:.1f},{:.1f}", p.x - left_mm, top_mm - (from_above ? -p.z : p.y));
  }
};

std::string outline(const PlacedPanel& placed, const Projection& projection) {
  const double x = width_mm(placed) / 2.0, y = height_mm(placed) / 2.0;
  std::string points;
  for (const Vec3 corner :
       std::array{Vec3{-x, -y, 0}, Vec3{x, -y, 0}, Vec3{x, y, 0}, Vec3{-x, y, 0}})
    points += projection.at(placed.wall_from_panel.point(corner)) + " ";
  points.pop_back();
  return fmt::format("<polygon points=\"{}\"/>\n", points);
}

/// Returns a drawing in millimetres: the wall from the front, and below it from above with the
/// viewer.
std::string drawing(const PlacedWall& wall) {
  constexpr double kMargin = 50.0;
  Interval x, y, z;
  for (const PlacedPanel& placed : wall.panels) {
    x.extend(placed.x_mm);
    y.extend(placed.y_mm);
    z.extend(placed.wall_from_panel.origin.z);
    for (const double side : {-0.5, 0.5})
      z.extend(placed.wall_from_panel.point({side * width_mm(placed), 0.0, 0.0}).z);
  }
  x.extend(wall.viewer_mm.x);
  z.extend(wall.viewer_mm.z);
  const double front_mm = y.width() + 2.0 * kMargin;
  const Projection front{x.low - kMargin, y.high + kMargin, false};
  const Projection above{x.low - kMargin, -z.low + kMargin + front_mm, true};
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.1f} {:.1f}\" "
      "font-family=\"sans-serif\" font-size=\"40\" text-anchor=\"middle\">\n"
      "<g fill=\"#dce6f2\" stroke=\"#1f3b64\" stroke-width=\"4\">\n",
      x.width() + 2.0 * kMargin, front_mm + z.width() + 2.0 * kMargin);
  for (const Projection& projection : {front, above})
    for (const PlacedPanel& placed : wall.panels) out += outline(placed, projection);
  const auto text = [&out](const Vec3& at, const Projection& projection, const std::string& what) {
    const std::string place = projection.at(at);
    const size_t comma = place.find(',');
    out += fmt::format("<text x=\"{}\" y=\"{}\">{}</text>\n", place.substr(0, comma),
                       place.substr(comma + 1), what);
  };
  out += "</g>\n<g fill=\"#1f3b64\">\n";
  for (const PlacedPanel& placed : wall.panels)
    text(placed.wall_from_panel.origin, front, placed.name);
  text(wall.viewer_mm, above, "viewer");
  return out + "</g>\n</svg>\n";
}

/// Writes each panel's rig, with the viewing line and the trim that its film is rendered with.
void write_rigs(const PlacedWall& wall, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (const PlacedPanel& placed : wall.panels) {
    const std::filesystem::path file = folder / (placed.name + ".toml");
    (void)optics::save_with_history(placed.calibrated, file);
    optics::save_trim(placed.trim, file);
    say("{}: written\n", file.string());
  }
}

}  // namespace

void declare_rig_wall_flags(CLI::App& app, RigWallFlags& flags) {
  app.add_option("WALL", flags.file, "wall file")->required();
  app.add_option("--svg", flags.svg, "write a drawing of the wall from the front and from above")
      ->type_name("FILE");
  app.add_option("--rigs", flags.rigs,
                 "write the rig of each panel as it hangs in the wall, for players and 'eye'")
      ->type_name("FOLDER");
}

ExitCode rig_wall(const RigWallFlags& flags, bool as_json) {
  const PlacedWall wall = optics::load_wall(flags.file);
  if (!flags.svg.empty()) write_text_file(flags.svg, drawing(wall));
  if (!flags.rigs.empty()) write_rigs(wall, flags.rigs);
  if (as_json)
    print_json(wall_json(wall));
  else
    print_wall(wall);
  return kOk;
}

}  // namespace lenticule::tools
