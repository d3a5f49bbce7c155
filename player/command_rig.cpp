// SPDX-License-Identifier: Apache-2.0
// lenticule rig show|check|import|export
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "optics/calibration_import.h"
#include "optics/error.h"
#include "optics/model.h"
#include "optics/rig_file.h"
#include "optics/text_file.h"
#include "player/command.h"

namespace lenticule::player {
namespace {

using nlohmann::json;
using optics::OpticalModel;
using optics::Rig;

constexpr size_t kMaxCalibrationBytes = 4u << 20;

struct RigOptions {
  std::string file;
  std::string output;
  std::string format = "auto";
  bool as_json = false;
};

double degrees(double tangent) {
  return std::atan(tangent) * 180.0 / std::numbers::pi;
}

/// JSON has no infinity; null stands for it.
json finite_or_null(double value) {
  return std::isfinite(value) ? json(value) : json();
}

/// As lines of text, sections indented: what the JSON says and nothing else.
void print_text(const json& value, int indent = 0) {
  for (const auto& [key, member] : value.items()) {
    if (member.is_object()) {
      fmt::print("{:{}}{}\n", "", indent, key);
      print_text(member, indent + 2);
    } else if (member.is_array() && !member.empty() && member.front().is_string()) {
      for (const json& line : member)
        fmt::print("{:{}}{}: {}\n", "", indent, key, line.get<std::string>());
    } else {
      const std::string text = member.is_null()     ? "infinite"
                               : member.is_string() ? member.get<std::string>()
                               : member.is_number_float()
                                   ? fmt::format("{:.7g}", member.get<double>())
                                   : member.dump();
      fmt::print("{:{}}{:<{}} {}\n", "", indent, key, 26 - indent, text);
    }
  }
}

void print_result(const json& value, bool as_json) {
  if (as_json) {
    print_json(value);
  } else {
    print_text(value);
  }
}

json panel_json(const optics::Panel& panel) {
  return {{"width_px", panel.width_px},
          {"height_px", panel.height_px},
          {"pixel_width_mm", panel.pixel_width.value},
          {"pixel_height_mm", panel.pixel_height.value},
          {"width_mm", panel.width_px * panel.pixel_width.value},
          {"height_mm", panel.height_px * panel.pixel_height.value},
          {"layout", panel.layout.name()}};
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

/// Pitch of the micro-images for a viewer at the design distance.
double effective_pitch(const Rig& rig) {
  const double z = rig.viewing.distance.value;
  return rig.sheet.pitch.value * (1.0 + (std::isinf(z) ? 0.0 : rig.sheet.gap.value / z));
}

json derived_json(const OpticalModel& model) {
  const Rig& rig = model.rig();
  const double z = rig.viewing.distance.value;
  return {{"effective_pitch_subpx", effective_pitch(rig)},
          {"lens_pitch_mm", model.pitch_mm()},
          {"lens_count", 3.0 * rig.panel.width_px / rig.sheet.pitch.value},
          {"views_per_lens", rig.sheet.pitch.value},
          {"lobe_width_mm", finite_or_null(model.lobe_width_mm(z))},
          {"lobe_degrees", 2.0 * degrees(0.5 * model.pitch_mm() / rig.sheet.gap.value)},
          {"depth_of_field_mm", model.depth_of_field_mm()}};
}

ExitCode show(const RigOptions& options) {
  const OpticalModel model(optics::load_rig(options.file));
  const Rig& rig = model.rig();
  json out = {{"name", rig.name},
              {"fingerprint", optics::fingerprint(rig)},
              {"panel", panel_json(rig.panel)},
              {"sheet", sheet_json(rig.sheet, rig.panel)},
              {"viewing",
               {{"distance_mm", finite_or_null(rig.viewing.distance.value)},
                {"height_mm", rig.viewing.height.value}}},
              {"derived", derived_json(model)}};
  for (const auto& [key, text] : rig.provenance) out["provenance"][key] = text;
  print_result(out, options.as_json);
  return kOk;
}

/// What is possible but unlikely to be meant.
std::vector<std::string> warnings_about(const OpticalModel& model) {
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
       "panel.pixel_width_mm: no usual pixel size");
  warn(std::abs(sheet.slant * aspect) > 1.0, "sheet.slant: steeper than 45 degrees");
  warn(sheet.pitch.value < 4.0, "sheet.pitch_subpx: fewer than four subpixels per lens");
  warn(std::isfinite(lobe) && lobe < kEyesMm,
       fmt::format("a viewing zone is {:.0f} mm wide: no room for two eyes", lobe));
  warn(std::isfinite(lobe) && lobe > z, "a viewing zone is wider than the viewing distance");
  warn(sheet.refraction_shape < 0.3, "sheet.refraction_shape: a refractive index above 1.8");
  warn(sheet.spot_sigma.value > 0.25, "sheet.spot_sigma_lenses: neighbouring views run together");
  const auto largest =
      std::max_element(sheet.residual.lenses.begin(), sheet.residual.lenses.end(),
                       [](double a, double b) { return std::abs(a) < std::abs(b); });
  warn(largest != sheet.residual.lenses.end() && std::abs(*largest) > 1.0,
       "sheet.residual: corrections of more than a whole lens");
  return warnings;
}

ExitCode check(const RigOptions& options) {
  try {
    const OpticalModel model(optics::load_rig(options.file));
    const std::vector<std::string> warnings = warnings_about(model);
    if (options.as_json) {
      print_json({{"file", options.file}, {"valid", true}, {"warnings", warnings}});
    } else {
      for (const std::string& warning : warnings) fmt::print("warning: {}\n", warning);
      fmt::print("{}: valid, {} warning{}\n", options.file, warnings.size(),
                 warnings.size() == 1 ? "" : "s");
    }
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

/// CubeVi values have an interval; a visual.json has a pitch.
std::string recognised_format(const std::string& text) {
  const bool is_cubevi = text.find("\"interval\"") != std::string::npos;
  return is_cubevi ? "cubevi" : "lkg";
}

struct Import {
  Rig rig;
  /// Views are numbered from the right, which is no part of a rig: whoever weaves has to say it.
  bool inverted_views = false;
};

Import import_as(const std::string& format, const std::string& text, const std::string& source) {
  if (format == "cubevi") return {.rig = optics::import_cubevi(text, source)};
  optics::LookingGlassImport import = optics::import_looking_glass(text, source);
  // Its invView is set where views run as ours do.
  return {.rig = std::move(import.rig), .inverted_views = !import.views.inverted};
}

ExitCode import_calibration(const RigOptions& options) {
  const std::string text = optics::read_text_file(options.file, kMaxCalibrationBytes);
  const std::string format = options.format == "auto" ? recognised_format(text) : options.format;
  const auto [rig, inverted_views] = import_as(format, text, options.file);
  optics::save_rig(rig, options.output);
  if (inverted_views)
    fmt::print(stderr,
               "lenticule: {}: invView is 0: its views are numbered from the right\n"
               "  weave quilts and views for this panel with 'lenticule weave --invert'\n",
               options.file);
  print_result({{"format", format},
                {"output", options.output},
                {"name", rig.name},
                {"fingerprint", optics::fingerprint(rig)},
                {"pitch_subpx", rig.sheet.pitch.value},
                {"slant", rig.sheet.slant},
                {"gap_mm", rig.sheet.gap.value},
                {"views_inverted", inverted_views}},
               options.as_json);
  return kOk;
}

/// How far what the exported file says is from the rig, over the panel: the other formats have no
/// viewing distance and no refraction.
double largest_phase_error(const Rig& rig, const Rig& exported) {
  constexpr int kAcross = 32;
  const OpticalModel ours(rig), theirs(exported);
  double largest = 0.0;
  for (int n = 0; n <= kAcross * kAcross; ++n) {
    const double x = rig.panel.width_px * (n % (kAcross + 1)) / static_cast<double>(kAcross);
    const double y = rig.panel.height_px * (n / (kAcross + 1)) / static_cast<double>(kAcross);
    const double difference =
        ours.phase(x, y, 1, ours.design_eye()) - theirs.phase(x, y, 1, theirs.design_eye());
    largest = std::max(largest, std::abs(difference - std::round(difference)));
  }
  return largest;
}

ExitCode export_calibration(const RigOptions& options) {
  const Rig rig = optics::load_rig(options.file);
  const std::string text =
      options.format == "cubevi" ? optics::export_cubevi(rig) : optics::export_looking_glass(rig);
  const double error =
      largest_phase_error(rig, import_as(options.format, text, options.output).rig);
  optics::write_text_file(options.output, text);
  if (error > 0.01) {
    fmt::print(stderr,
               "lenticule: {}: up to {:.3f} lens off at the panel's edges\n"
               "  the format has no viewing distance and no refraction\n",
               options.output, error);
  }
  print_result({{"format", options.format},
                {"output", options.output},
                {"largest_phase_error_lenses", error}},
               options.as_json);
  return kOk;
}

using Action = ExitCode (*)(const RigOptions&);

CLI::App* add_action(CLI::App& app, const char* name, const char* summary, const char* example,
                     const std::shared_ptr<RigOptions>& options) {
  CLI::App* sub = app.add_subcommand(name, summary);
  sub->footer(fmt::format("Example:\n  {}", example));
  sub->add_flag("--json", options->as_json, "print JSON");
  return sub;
}

}  // namespace

Run declare_rig(CLI::App& app) {
  auto options = std::make_shared<RigOptions>();
  app.require_subcommand(1);

  CLI::App* show_app = add_action(app, "show", "print what a rig is and what follows from it",
                                  "lenticule rig show kiosk-27-4k.toml", options);
  show_app->add_option("RIG", options->file, "rig file")->required();

  CLI::App* check_app = add_action(app, "check", "say whether a rig is valid and plausible",
                                   "lenticule rig check kiosk-27-4k.toml", options);
  check_app->add_option("RIG", options->file, "rig file")->required();

  CLI::App* import_app =
      add_action(app, "import", "make a rig file from another system's calibration",
                 "lenticule rig import visual.json -o portrait.toml", options);
  import_app->add_option("FILE", options->file, "calibration file")->required();
  import_app->add_option("-o,--output", options->output, "rig file to write")->required();
  import_app->add_option("--format", options->format, "auto, lkg (visual.json) or cubevi")
      ->check(CLI::IsMember({"auto", "lkg", "cubevi"}))
      ->capture_default_str();

  CLI::App* export_app =
      add_action(app, "export", "write a rig as another system's calibration",
                 "lenticule rig export kiosk-27-4k.toml --format lkg -o visual.json", options);
  export_app->add_option("RIG", options->file, "rig file")->required();
  export_app->add_option("--format", options->format, "lkg (visual.json) or cubevi")
      ->check(CLI::IsMember({"lkg", "cubevi"}))
      ->required();
  export_app->add_option("-o,--output", options->output, "file to write")->required();

  const std::vector<std::pair<const CLI::App*, Action>> actions = {
      {show_app, show},
      {check_app, check},
      {import_app, import_calibration},
      {export_app, export_calibration}};
  return [options, actions]() -> ExitCode {
    for (const auto& [sub, action] : actions) {
      if (sub->parsed()) return action(*options);
    }
    throw Error(ErrorKind::Usage, "rig: no action", "see lenticule rig --help");
  };
}

}  // namespace lenticule::player
