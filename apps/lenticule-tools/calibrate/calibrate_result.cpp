// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/calibrate_result.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "base/statistics.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Returns "kiosk.report.html" for "kiosk.toml".
std::string report_beside(const std::string& rig_file) {
  fs::path name(rig_file);
  name.replace_extension(".report.html");
  return name.string();
}

void print_text(const calib::Calibration& found, const json& files) {
  print_out("{}\n{}\n", calib::verdict_headline(found.verdict), calib::verdict_explained(found));
  for (const std::string& reason : found.reasons) print_out("  - {}\n", reason);
  for (const std::string& finding : found.link.findings) print_out("  - {}\n", finding);
  for (const std::string& warning : found.warnings) print_out("  note: {}\n", warning);
  for (const calib::Parameter& p : found.parameters)
    print_out("  {:<28} {} {}\n", p.name, calib::with_error(p.estimate), p.unit);
  for (const std::string& advice : calib::advice(found)) print_out("  next: {}\n", advice);
  for (const auto& [what, file] : files.items())
    if (file.is_string()) print_out("{}: {}\n", what, file.get<std::string>());
}

}  // namespace

void declare_result_flags(CLI::App& app, ResultFlags& flags) {
  app.option_defaults()->group("Result");
  app.add_option("-o,--output", flags.output,
                 "rig file to write; an existing one is kept under a number")
      ->type_name("RIG.toml")
      ->required();
  app.add_option("--report", flags.report, "HTML report")
      ->type_name("FILE")
      ->default_str("beside the rig file");
  app.add_option("--temperature", flags.temperature, "room temperature, recorded in the rig")
      ->type_name("CELSIUS");
  app.add_flag("--json", flags.json, "print the whole report as JSON");
  app.option_defaults()->group("Options");
}

void declare_display_flags(CLI::App& app, DisplayFlags& flags) {
  app.add_option("--display", flags.display, "kms, kms:CONNECTOR, or virtual")
      ->type_name("DISPLAY")
      ->capture_default_str();
  app.add_flag("--allow-inexact", flags.allow_inexact,
               "with kms: show patterns even if subpixels are known to arrive changed");
}

PatternDisplay::PatternDisplay(const DisplayFlags& flags, const optics::Rig& rig)
    : display_([&] {
        display::DisplayRequest request = display::request_for(rig, flags.display);
        request.kms.allow_inexact = flags.allow_inexact;
        return display::open_display(request);
      }()),
      sink_(*display_) {}

void PatternDisplay::show(const frames::WovenFrame& frame) {
  if (sink_.show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
    throw Error(ErrorKind::Device, "display: the pattern was not displayed");
}

void PatternDisplay::pause() {
  const auto event = display_->wait_event(display_->now() + std::chrono::milliseconds(200),
                                          player::interrupt_fd());
  if (event.kind == display::EventKind::Lost)
    throw Error(ErrorKind::Device, "display: disconnected", "connect it again");
}

void PatternDisplay::hold(double seconds) {
  const auto end = display_->now() + std::chrono::duration_cast<display::Nanoseconds>(
                                         std::chrono::duration<double>(seconds));
  while (!player::interrupted() && (seconds <= 0.0 || display_->now() < end)) pause();
}

ExitCode conclude_calibration(const calib::Calibration& found, calib::RecordDetails details,
                              const ResultFlags& flags, const json& more) {
  details.temperature_celsius = flags.temperature;
  const std::string report = flags.report.empty() ? report_beside(flags.output) : flags.report;
  write_text_file(report, calib::report_html(found, details));
  json files = {{"report", report}, {"rig", nullptr}, {"old_rig_kept_as", nullptr}};
  if (!flags.picture.empty()) files["picture"] = flags.picture;
  const bool saved = found.verdict != calib::Verdict::Refused;
  if (saved) {
    const fs::path kept =
        optics::save_with_history(calib::with_record(found, details), flags.output);
    // The new calibration includes the drift that the old trim corrected.
    optics::save_trim({}, flags.output);
    files["rig"] = flags.output;
    if (!kept.empty()) files["old_rig_kept_as"] = kept.string();
  }
  if (flags.json) {
    json out = calib::report_json(found, details);
    out["files"] = files;
    out.update(more);
    print_json(out);
  } else {
    print_text(found, files);
  }
  return saved ? kOk : kQuality;
}

namespace {

constexpr int kPreviewWidth = 960;
constexpr double kBrightPart = 0.99;

float light_at(const calib::CameraPicture& picture, int x, int y, int channel) {
  const auto channels = static_cast<size_t>(picture.channels);
  const size_t pixel =
      static_cast<size_t>(y) * static_cast<size_t>(picture.width) + static_cast<size_t>(x);
  return picture.light[pixel * channels + std::min(static_cast<size_t>(channel), channels - 1)];
}

}  // namespace

void write_picture(const calib::CameraPicture& picture, const std::string& file) {
  const int step = std::max(1, (picture.width + kPreviewWidth - 1) / kPreviewWidth);
  frames::WovenFrame small({.width = picture.width / step, .height = picture.height / step});
  for (int y = 0; y < small.height(); ++y)
    for (int x = 0; x < small.width(); ++x)
      for (int c = 0; c < 3; ++c) {
        float sum = 0.0F;
        for (int v = 0; v < step; ++v)
          for (int u = 0; u < step; ++u) sum += light_at(picture, x * step + u, y * step + v, c);
        small.row(y)[3 * x + c] =
            frames::code_from_linear(double{sum} / static_cast<double>(step * step));
      }
  frames::write_woven(small.view(), file);
}

bool write_preview(calib::Camera& camera, const std::string& file) {
  calib::CameraPicture picture;
  if (camera.grab(picture, std::chrono::seconds(1)) != calib::GrabStatus::Ready) return false;
  write_picture(picture, file);
  return true;
}

std::string light_of(const calib::CameraPicture& picture) {
  const std::vector<float>& light = picture.light;
  if (light.empty()) return "no light measured";
  const auto clipped =
      std::ranges::count_if(light, [](float v) { return v >= calib::kSaturatedLight; });
  return fmt::format("brightest {:.0f} % of full scale, clipped {:.1f} % of the picture",
                     100.0 * double{quantile(light, kBrightPart)},
                     100.0 * static_cast<double>(clipped) / static_cast<double>(light.size()));
}
}  // namespace lenticule::tools
