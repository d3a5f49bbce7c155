// SPDX-License-Identifier: Apache-2.0
// lenticule rig show|check|import|export|trim|mount|wall shows, checks, converts, trims and turns
// rig files. rig wall shows the panels of a wall, the gaps between them and a drawing, and writes
// the rigs with which players show the films of the panels.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/json_output.h"
#include "base/print.h"
#include "optics/calibration_import.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "optics/units.h"
#include "optics/wall/wall.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

struct RigOptions {
  std::string file;  ///< rig or wall
  std::string output;
  std::string format = "auto";
  std::string mounting;
  double offset_by = 0.0;
  double pitch_by = 0.0;
  std::string svg;
  std::string rigs;  ///< folder for the rigs of a wall's panels
  bool reset_trim = false;
  bool as_json = false;
  ExitCode (*action)(const RigOptions&) = nullptr;  ///< runs the given subcommand
};

using nlohmann::json;
using optics::PlacedPanel;
using optics::PlacedWall;

double width_mm(const optics::Panel& panel) { return panel.width_px * panel.pixel_width.value; }
double height_mm(const optics::Panel& panel) { return panel.height_px * panel.pixel_height.value; }

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

/// Returns the gaps, as the viewer sees them, of panels that overlap in height or in width, and are
/// nearer to each other than another panel between them would allow.
json gaps_json(const PlacedWall& wall) {
  json gaps = json::array();
  for (size_t a = 0; a < wall.panels.size(); ++a)
    for (size_t b = a + 1; b < wall.panels.size(); ++b) {
      const PlacedPanel &one = wall.panels[a], &other = wall.panels[b];
      const double x = distance(one.x_mm, other.x_mm), y = distance(one.y_mm, other.y_mm);
      const bool beside = x > y;
      const double smaller = beside ? std::min(one.x_mm.width(), other.x_mm.width())
                                    : std::min(one.y_mm.width(), other.y_mm.width());
      if (std::min(x, y) < 0.0 && std::max(x, y) < smaller)
        gaps.push_back({{"panels", {one.name, other.name}},
                        {"beside", beside},  // else one above the other
                        {"gap_mm", std::max(x, y)}});
    }
  return gaps;
}

json wall_json(const PlacedWall& wall) {
  json panels = json::array();
  for (const PlacedPanel& placed : wall.panels) {
    const Vec3 centre = placed.wall_from_panel.origin;
    const optics::ViewingLine& line = placed.calibrated.viewing;
    const optics::Panel& panel = placed.calibrated.panel;
    panels.push_back({{"name", placed.name},
                      {"width_px", panel.width_px},
                      {"height_px", panel.height_px},
                      {"width_mm", width_mm(panel)},
                      {"height_mm", height_mm(panel)},
                      {"centre_mm", {centre.x, centre.y, centre.z}},
                      {"viewer_mm", {line.centre.value, line.height.value, line.distance.value}},
                      {"viewer_degrees", viewer_degrees(placed)},
                      {"fingerprint", placed.trimmed.identity.fingerprint}});
  }
  return {{"panels", panels}, {"gaps", gaps_json(wall)}};
}

void print_wall(const json& wall) {
  for (const json& panel : wall["panels"]) {
    const auto number = [](const json& value) { return value.get<double>(); };
    const json& centre = panel["centre_mm"];
    print_out(
        "{}: {}x{} pixels, {:.1f} x {:.1f} mm, centre at {:.1f}, {:.1f}, {:.1f} mm, the viewer "
        "{:.1f} degrees off its normal\n",
        panel["name"].get<std::string>(), panel["width_px"].get<int>(),
        panel["height_px"].get<int>(), number(panel["width_mm"]), number(panel["height_mm"]),
        number(centre[0]), number(centre[1]), number(centre[2]), number(panel["viewer_degrees"]));
  }
  for (const json& gap : wall["gaps"]) {
    const auto gap_mm = gap["gap_mm"].get<double>();
    print_out("{} and {}: {:.1f} mm {}, {}\n", gap["panels"][0].get<std::string>(),
              gap["panels"][1].get<std::string>(), std::abs(gap_mm),
              gap_mm < 0.0 ? "overlap" : "apart",
              gap["beside"].get<bool>() ? "side by side" : "one above the other");
  }
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
  const optics::Panel& panel = placed.calibrated.panel;
  const double x = width_mm(panel) / 2.0, y = height_mm(panel) / 2.0;
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
      z.extend(
          placed.wall_from_panel.point({side * width_mm(placed.calibrated.panel), 0.0, 0.0}).z);
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
    out += fmt::format("<text transform=\"translate({})\">{}</text>\n", projection.at(at), what);
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

/// Throws Error(Input) and Error(Failed).
ExitCode rig_wall(const RigOptions& options) {
  const PlacedWall wall = optics::load_wall(options.file);
  if (!options.svg.empty()) write_text_file(options.svg, drawing(wall));
  if (!options.rigs.empty()) write_rigs(wall, options.rigs);
  lenticule::print_result(wall_json(wall), options.as_json, print_wall);
  return kOk;
}

using optics::OpticalModel;
using optics::Rig;

constexpr size_t kMaxCalibrationBytes = 4u << 20;

double degrees(double tangent) { return std::atan(tangent) * 180.0 / std::numbers::pi; }

/// Prints the JSON as lines of text with indented sections.
void print_text(const json& value, int indent = 0) {
  for (const auto& [key, member] : value.items()) {
    if (member.is_object()) {
      print_out("{:{}}{}\n", "", indent, key);
      print_text(member, indent + 2);
    } else if (member.is_array() && !member.empty() && member.front().is_string()) {
      for (const json& line : member)
        print_out("{:{}}{}: {}\n", "", indent, key, line.get<std::string>());
    } else {
      const std::string text = member.is_null()     ? "infinite"
                               : member.is_string() ? member.get<std::string>()
                               : member.is_number_float()
                                   ? fmt::format("{:.7g}", member.get<double>())
                                   : json_text(member);
      print_out("{:{}}{:<{}} {}\n", "", indent, key, 26 - indent, text);
    }
  }
}

void print_result(const json& value, bool as_json) {
  lenticule::print_result(value, as_json, [](const json& result) { print_text(result); });
}

json panel_json(const optics::Panel& panel) {
  return {{"width_px", panel.width_px},
          {"height_px", panel.height_px},
          {"pixel_width_mm", panel.pixel_width.value},
          {"pixel_height_mm", panel.pixel_height.value},
          {"width_mm", width_mm(panel)},
          {"height_mm", height_mm(panel)},
          {"layout", panel.layout.name()},
          {"mounting", optics::mounting_name(panel.mounting)},
          {"bits", panel.bits},
          {"sent_width_px", panel.sent_size().width},
          {"sent_height_px", panel.sent_size().height}};
}

json sheet_json(const optics::LensSheet& sheet, const optics::Panel& panel) {
  return {
      {"pitch_subpx", sheet.pitch.value},
      {"slant", sheet.slant},
      {"slant_degrees", degrees(sheet.slant * panel.pixel_width.value / panel.pixel_height.value)},
      {"offset_lenses", sheet.offset.value},
      {"gap_mm", sheet.gap.value},
      {"refraction_shape", sheet.refraction_shape},
      {"spot_sigma_lenses", sheet.spot_sigma.value},
      {"channel_offset_subpx",
       {sheet.channel_offset[0].value, sheet.channel_offset[1].value,
        sheet.channel_offset[2].value}},
      {"residual_columns", sheet.residual.columns},
      {"residual_rows", sheet.residual.rows}};
}

json derived_json(const OpticalModel& model) {
  const Rig& rig = model.rig();
  const double z = rig.viewing.distance.value;
  return {{"effective_pitch_subpx", optics::effective_sheet(rig).pitch.value},
          {"lens_pitch_mm", model.pitch_mm()},
          {"lens_count", 3.0 * rig.panel.width_px / rig.sheet.pitch.value},
          {"views_per_lens", rig.sheet.pitch.value},
          {"lobe_width_mm", finite_or_null(model.lobe_width_mm(z))},
          {"lobe_degrees", 2.0 * degrees(0.5 * model.pitch_mm() / rig.sheet.gap.value)},
          {"depth_of_field_mm", model.depth_of_field_mm()}};
}

/// Returns the trim in the file beside the rig; it is included in all other numbers.
json trim_json(const optics::Trim& trim, const std::string& rig_file) {
  return {{"file", optics::trim_file_of(rig_file).string()},
          {"offset_lenses", trim.offset.value},
          {"pitch_relative", trim.pitch_relative},
          {"fingerprint_without_trim", optics::fingerprint(optics::load_rig(rig_file))}};
}

ExitCode show_rig(const RigOptions& options) {
  const OpticalModel model(optics::load_trimmed_rig(options.file));
  const Rig& rig = model.rig();
  const optics::Trim trim = optics::load_trim(options.file);
  json out = {{"name", rig.name},
              {"fingerprint", optics::fingerprint(rig)},
              {"panel", panel_json(rig.panel)},
              {"sheet", sheet_json(rig.sheet, rig.panel)},
              {"viewing",
               {{"distance_mm", finite_or_null(rig.viewing.distance.value)},
                {"height_mm", rig.viewing.height.value},
                {"centre_mm", rig.viewing.centre.value}}},
              {"derived", derived_json(model)}};
  for (const auto& [key, text] : rig.provenance) out["provenance"][key] = text;
  if (!trim.empty()) out["trim"] = trim_json(trim, options.file);
  print_result(out, options.as_json);
  return kOk;
}

/// Returns warnings about values that are possible and probably wrong.
std::vector<std::string> warnings_about(const OpticalModel& model, const optics::Trim& trim) {
  constexpr double kEyesMm = 65.0;
  const Rig& rig = model.rig();
  const optics::LensSheet& sheet = rig.sheet;
  const double z = rig.viewing.distance.value;
  const double aspect = rig.panel.pixel_width.value / rig.panel.pixel_height.value;
  const double lobe = model.lobe_width_mm(z);
  std::vector<std::string> warnings;
  const auto warn = [&](bool unlikely, std::string text) {
    if (unlikely) warnings.push_back(std::move(text));
  };
  warn(std::abs(aspect - 1.0) > 0.01, "panel: the pixels are not square");
  warn(rig.panel.pixel_width.value < 0.02 || rig.panel.pixel_width.value > 2.0,
       "panel.pixel_width_mm: unusual; most panels have 0.02 to 2");
  warn(std::abs(sheet.slant * aspect) > 1.0, "sheet.slant: steeper than 45 degrees");
  warn(sheet.pitch.value < 4.0, "sheet.pitch_subpx: fewer than four subpixels per lens");
  warn(std::isfinite(lobe) && lobe < kEyesMm,
       fmt::format("sheet: a lobe is {:.0f} mm wide, too narrow for two eyes", lobe));
  warn(std::isfinite(lobe) && lobe > z, "sheet: a lobe is wider than the viewing distance");
  warn(sheet.refraction_shape < 0.3, "sheet.refraction_shape: a refractive index above 1.8");
  warn(sheet.spot_sigma.value > 0.25,
       "sheet.spot_sigma_lenses: so large that neighbouring views overlap");
  const auto largest = std::ranges::max_element(
      sheet.residual.lenses, [](double a, double b) { return std::abs(a) < std::abs(b); });
  warn(largest != sheet.residual.lenses.end() && std::abs(*largest) > 1.0,
       "sheet.residual: corrections of more than a whole lens");
  // A sheet of acrylic expands by 7e-5 per kelvin relative to the panel's glass.
  warn(std::abs(trim.pitch_relative) > 1e-3 || std::abs(trim.offset.value) > 0.5,
       "trim: larger than a drift; calibrate again");
  return warnings;
}

ExitCode check_rig(const RigOptions& options) {
  try {
    const OpticalModel model(optics::load_trimmed_rig(options.file));
    const auto warnings = warnings_about(model, optics::load_trim(options.file));
    const auto print_warnings = [&](const json&) {
      for (const std::string& warning : warnings) print_out("warning: {}\n", warning);
      print_out("{}: valid, {} warning{}\n", options.file, warnings.size(),
                warnings.size() == 1 ? "" : "s");
    };
    lenticule::print_result({{"file", options.file}, {"valid", true}, {"warnings", warnings}},
                            options.as_json, print_warnings);
    return kOk;
  } catch (const Error& error) {
    if (!options.as_json || error.kind() != ErrorKind::Input) throw;
    print_json({{"file", options.file},
                {"valid", false},
                {"error", error.what()},
                {"hint", error.hint()}});
    return kInput;
  }
}

/// Writes a rig in place of an older one, whose trim does not belong to it. `done` states where the
/// older one is kept.
void replace_rig(const Rig& rig, const RigOptions& options, json& done) {
  const std::filesystem::path kept = optics::save_with_history(rig, options.output);
  optics::save_trim({}, options.output);
  if (!kept.empty()) done["old_rig_kept_as"] = kept.string();
}

struct Import {
  Rig rig;
  /// True if views are numbered from the right. A rig does not store this, so it must be set when
  /// weaving.
  bool inverted_views = false;
};

Import import_as(const std::string& format, const std::string& text, const std::string& source) {
  if (format == "cubevi") return {.rig = optics::import_cubevi(text, source)};
  optics::LookingGlassImport import = optics::import_looking_glass(text, source);
  // The file's invView is set if its views are numbered in this project's order.
  return {.rig = std::move(import.rig), .inverted_views = !import.views.inverted};
}

ExitCode import_calibration(const RigOptions& options) {
  const std::string text = read_text_file(options.file, kMaxCalibrationBytes);
  std::string format = options.format;
  if (format == "auto")  // CubeVi files have an interval, a visual.json has a pitch
    format = text.find("\"interval\"") != std::string::npos ? "cubevi" : "lkg";
  const auto [rig, inverted_views] = import_as(format, text, options.file);
  json done = {{"format", format},
               {"output", options.output},
               {"name", rig.name},
               {"fingerprint", optics::fingerprint(rig)},
               {"pitch_subpx", rig.sheet.pitch.value},
               {"slant", rig.sheet.slant},
               {"gap_mm", rig.sheet.gap.value},
               {"views_inverted", inverted_views}};
  if (options.as_json) done["old_rig_kept_as"] = nullptr;
  replace_rig(rig, options, done);
  if (inverted_views)
    say("lenticule: {}: invView is 0: its views are numbered from the right\n"
        "  weave quilts and views for this panel with 'lenticule weave --invert'\n",
        options.file);
  print_result(done, options.as_json);
  return kOk;
}

ExitCode export_calibration(const RigOptions& options) {
  if (options.output.empty() || options.format == "auto")
    throw Error(ErrorKind::Usage, "rig export: no output requested",
                "use --format lkg or cubevi and -o FILE");
  const Rig rig = optics::load_trimmed_rig(options.file);
  const std::string text =
      options.format == "cubevi" ? optics::export_cubevi(rig) : optics::export_looking_glass(rig);
  const Rig exported = import_as(options.format, text, options.output).rig;
  const double error = optics::largest_phase_difference(
      rig, OpticalModel(rig).design_eye(), exported, OpticalModel(exported).design_eye());
  write_text_file(options.output, text);
  if (error > 0.01) {
    say("lenticule: {}: up to {:.3f} lens off at the panel's edges\n"
        "  the format has no viewing distance and no refraction\n",
        options.output, error);
  }
  print_result({{"format", options.format},
                {"output", options.output},
                {"largest_phase_error_lenses", error}},
               options.as_json);
  return kOk;
}

/// Changes the trim by increments.
ExitCode change_trim(const RigOptions& options) {
  const Rig rig = optics::load_rig(options.file);
  const optics::Trim before = optics::load_trim(options.file);
  const optics::Trim after = optics::changed_by(options.reset_trim ? optics::Trim{} : before,
                                                options.offset_by, options.pitch_by);
  optics::validate_trim(after, "rig trim");
  optics::validate_rig(optics::trimmed(rig, after), options.file);
  if (after != before) optics::save_trim(after, options.file);
  const std::string fingerprint = optics::fingerprint(optics::trimmed(rig, after));
  print_result({{"file", optics::trim_file_of(options.file).string()},
                {"offset_lenses", after.offset.value},
                {"pitch_relative", after.pitch_relative},
                {"fingerprint", fingerprint}},
               options.as_json);
  if (fingerprint != optics::fingerprint(optics::trimmed(rig, before)))
    say("lenticule: {}: trimmed; films that were woven before do not follow the trim\n"
        "  render or weave them again; players and renderers use the trim from their next start\n",
        options.file);
  return kOk;
}

/// Writes the rig of the same panel hung in another way. A trim stays with the old file.
ExitCode mount(const RigOptions& options) {
  const Rig rig = optics::turned_rig(optics::load_trimmed_rig(options.file),
                                     optics::mounting_named(options.mounting));
  json done = {
      {"output", options.output},          {"mounting", optics::mounting_name(rig.panel.mounting)},
      {"width_px", rig.panel.width_px},    {"height_px", rig.panel.height_px},
      {"layout", rig.panel.layout.name()}, {"pitch_subpx", rig.sheet.pitch.value},
      {"slant", rig.sheet.slant},          {"fingerprint", optics::fingerprint(rig)}};
  replace_rig(rig, options, done);
  print_result(done, options.as_json);
  return kOk;
}

/// Runs an action on the given rig, or on that of the connected panel.
template <ExitCode (*run)(const RigOptions&)>
ExitCode on_chosen_rig(const RigOptions& options) {
  RigOptions chosen = options;
  chosen.file = player::choose_rig({.given = options.file, .display = "kms"}).file;
  return run(chosen);
}

}  // namespace

cli::Run declare_rig(CLI::App& app) {
  auto options = std::make_shared<RigOptions>();
  app.require_subcommand(1);
  const auto add = [&app, options](const char* name, decltype(options->action) action,
                                   const char* summary, const char* example) {
    CLI::App* sub = app.add_subcommand(name, summary);
    sub->footer(fmt::format("Example:\n  {}", example));
    sub->add_flag("--json", options->as_json, "print JSON");
    sub->callback([options, action] { options->action = action; });
    return sub;
  };
  const auto add_chosen_rig = [options](CLI::App* sub) {
    sub->add_option("RIG", options->file, "rig file")->default_str("that of the connected panel");
  };

  add_chosen_rig(add("show", on_chosen_rig<show_rig>,
                     "print a rig and the values that follow from it",
                     "lenticule rig show kiosk-27-4k.toml"));
  add_chosen_rig(add("check", on_chosen_rig<check_rig>,
                     "check whether a rig is valid and plausible",
                     "lenticule rig check kiosk-27-4k.toml"));

  CLI::App* import_app =
      add("import", import_calibration, "create a rig file from another system's calibration",
          "lenticule rig import visual.json -o portrait.toml");
  import_app->add_option("FILE", options->file, "calibration file")->required();
  cli::add_option(*import_app, "-o,--output RIG.toml", options->output, "rig file to write")
      ->required();
  cli::add_option(*import_app, "--format", options->format, "auto, lkg (visual.json) or cubevi")
      ->check(CLI::IsMember({"auto", "lkg", "cubevi"}));

  CLI::App* export_app =
      add("export", export_calibration, "write a rig as another system's calibration",
          "lenticule rig export kiosk-27-4k.toml --format lkg -o visual.json");
  export_app->add_option("RIG", options->file, "rig file")->required();
  export_app->add_option("--format", options->format, "lkg (visual.json) or cubevi")
      ->check(CLI::IsMember({"lkg", "cubevi"}));
  cli::add_option(*export_app, "-o,--output FILE", options->output, "file to write");

  CLI::App* trim_app = add("trim", on_chosen_rig<change_trim>,
                           "correct drift since a rig was calibrated, in a file beside it",
                           "lenticule rig trim kiosk-27-4k.toml --offset-by 0.02");
  add_chosen_rig(trim_app);
  trim_app->add_option("--offset-by", options->offset_by,
                       "shift the picture under the lenses by this many lenses: 0.02");
  trim_app->add_option("--pitch-by", options->pitch_by, "change the pitch by this fraction: 1e-5");
  trim_app->add_flag("--reset", options->reset_trim,
                     "start from the calibration, without the present trim");

  CLI::App* mount_app = add(
      "mount", mount, "write the rig of a panel that is hung in another way than it was measured",
      "lenticule rig mount kiosk-27-4k.toml 180 -o upside-down.toml");
  mount_app->add_option("RIG", options->file, "rig file")->required();
  mount_app
      ->add_option("MOUNTING", options->mounting,
                   "how the viewer sees the sent picture: 0, 90, 180 or 270 degrees clockwise, "
                   "mirrored, or 'mirrored 90' and so on")
      ->required();
  cli::add_option(*mount_app, "-o,--output RIG.toml", options->output, "rig file to write")
      ->required();

  CLI::App* wall_app =
      add("wall", rig_wall, "show a wall of several panels: sizes, gaps and a drawing",
          "lenticule rig wall lobby.toml --svg lobby.svg --rigs lobby");
  wall_app->add_option("WALL", options->file, "wall file")->required();
  cli::add_option(*wall_app, "--svg FILE", options->svg,
                  "write a drawing of the wall from the front and from above");
  cli::add_option(*wall_app, "--rigs FOLDER", options->rigs,
                  "write the rig of each panel as it hangs in the wall, for players and 'eye'");

  return [options]() -> ExitCode { return options->action(*options); };
}
}  // namespace lenticule::tools
