// SPDX-License-Identifier: Apache-2.0
// Common parts of the methods of `lenticule calibrate`: their entry in its list, the end of a
// calibration, and pictures of what a camera sees.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "base/statistics.h"
#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/report/report.h"
#include "display/display_sink.h"
#include "display/kms/inspect.h"
#include "display/open/open_display.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {

struct ResultFlags {
  std::string output;
  std::string report;
  std::string picture;  ///< already written picture to name in the result; empty: none
  std::optional<double> temperature;
  bool json = false;
};

/// Groups of methods in the help of `calibrate`.
inline constexpr const char* kWithCamera = "Subcommands, with a camera";
inline constexpr const char* kWithoutCamera = "Subcommands, without a camera";

/// DisplayFlags choose the display that shows patterns.
struct DisplayFlags {
  std::string display = "kms";
  bool allow_inexact = false;
};

/// Returns "kiosk.report.html" for "kiosk.toml".
inline std::string report_beside(const std::string& rig_file) {
  std::filesystem::path name(rig_file);
  name.replace_extension(".report.html");
  return name.string();
}

inline void print_text(const calib::Calibration& found, const nlohmann::json& files) {
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

inline void declare_result_flags(CLI::App& app, ResultFlags& flags) {
  app.option_defaults()->group("Result");
  cli::add_option(app, "-o,--output RIG.toml", flags.output,
                  "rig file to write; an existing one is kept under a number")
      ->required();
  cli::add_option(app, "--report FILE", flags.report, "HTML report")
      ->default_str("beside the rig file");
  cli::add_option(app, "--temperature CELSIUS", flags.temperature,
                  "room temperature, recorded in the rig");
  app.add_flag("--json", flags.json, "print the whole report as JSON");
  app.option_defaults()->group("Options");
}

inline void declare_display_flags(CLI::App& app, DisplayFlags& flags) {
  cli::add_option(app, "--display DISPLAY", flags.display, "kms, kms:CONNECTOR, or virtual");
  app.add_flag("--allow-inexact", flags.allow_inexact,
               "with kms: show patterns even if subpixels are known to arrive changed");
}

/// Returns a warning if a panel states a size, from its EDID, that is not the rig's. Photographs do
/// not show that all lengths are wrong alike; the rig is then wrong for every eye at the side.
inline std::string size_contradiction(const optics::Panel& panel, double width_mm,
                                      double height_mm) {
  const double rig = std::hypot(panel.width_px * panel.pixel_width.value,
                                panel.height_px * panel.pixel_height.value);
  const double stated = std::hypot(width_mm, height_mm);
  constexpr double kRoundedMm = 7.0, kRoundedPart = 0.005;  // EDIDs often state whole centimetres
  if (!(stated > 0.0) || std::abs(rig - stated) <= kRoundedMm + kRoundedPart * stated) return "";
  return fmt::format(
      "the panel states a diagonal of {:.0f} mm, the rig has {:.0f} mm ({:+.1f} %): measure the "
      "panel, or the rig will be wrong for eyes at the side",
      stated, rig, 100.0 * (rig / stated - 1.0));
}

/// PatternDisplay is a display that shows patterns. Thread safety: one thread.
class PatternDisplay {
 public:
  /// Throws the errors of display::open_display().
  PatternDisplay(const DisplayFlags& flags, const optics::Rig& rig)
      : display_([&] {
          display::DisplayRequest request = display::request_for(rig, flags.display);
          request.kms.allow_inexact = flags.allow_inexact;
          if (display::is_kms_spec(request.spec)) compare_size(request, rig.panel);
          return display::open_display(request);
        }()),
        sink_(*display_) {}

  [[nodiscard]] display::Display& device() { return *display_; }
  [[nodiscard]] display::DisplaySink& sink() { return sink_; }
  /// Throws Error(Device) if the frame does not appear.
  void show(const frames::WovenFrame& frame) {
    if (sink_.show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
      throw Error(ErrorKind::Device, "display: the pattern was not displayed");
  }
  /// Lets the display work for a moment. Throws Error(Device) if it was disconnected.
  void pause() {
    const auto event = display_->wait_event(display_->now() + std::chrono::milliseconds(200),
                                            player::interrupt_fd());
    if (event.kind == display::EventKind::Lost)
      throw Error(ErrorKind::Device, "display: disconnected", "connect it again");
  }
  /// Lets the display work for a time, or if that is 0, until the user interrupts.
  void hold(double seconds) {
    const auto end = display_->now() + std::chrono::duration_cast<display::Nanoseconds>(
                                           std::chrono::duration<double>(seconds));
    while (!player::interrupted() && (seconds <= 0.0 || display_->now() < end)) pause();
  }

 private:
  static void compare_size(const display::DisplayRequest& request, const optics::Panel& panel) {
    display::KmsOptions options = display::kms_options_of(request);
    if (!options.session) options.session = display::make_direct_session();
    const display::PanelSearch search = display::search_panel(options);
    if (search.present.size() != 1) return;
    const display::PanelInfo& seen = search.present.front();
    if (const std::string warning = size_contradiction(panel, seen.width_mm, seen.height_mm);
        !warning.empty())
      say("{}: {}\n", seen.connector, warning);
  }

  std::unique_ptr<display::Display> display_;
  display::DisplaySink sink_;
};

// The calibration methods, one file each; `lenticule calibrate` lists them.

/// A method, named by the word after `calibrate`: its parsed flags and the function to run.
struct CalibrateWay {
  const CLI::App* app = nullptr;
  cli::Run run;
};

/// Writes the report beside the rig, saves the rig unless it was refused (the old one is kept under
/// a number), and prints both paths. The JSON also gets the keys of `more`. Returns kOk, or
/// kQuality if the rig was not saved.
inline ExitCode conclude_calibration(const calib::Calibration& found, calib::RecordDetails details,
                                     const ResultFlags& flags,
                                     const nlohmann::json& more = nlohmann::json::object()) {
  details.temperature_celsius = flags.temperature;
  const std::string report = flags.report.empty() ? report_beside(flags.output) : flags.report;
  write_text_file(report, calib::report_html(found, details));
  nlohmann::json files = {{"report", report}, {"rig", nullptr}, {"old_rig_kept_as", nullptr}};
  if (!flags.picture.empty()) files["picture"] = flags.picture;
  const bool saved = found.verdict != calib::Verdict::Refused;
  if (saved) {
    const std::filesystem::path kept =
        optics::save_with_history(calib::with_record(found, details), flags.output);
    // The new calibration includes the drift that the old trim corrected.
    optics::save_trim({}, flags.output);
    files["rig"] = flags.output;
    if (!kept.empty()) files["old_rig_kept_as"] = kept.string();
  }
  if (flags.json) {
    nlohmann::json out = calib::report_json(found, details);
    out["files"] = files;
    out.update(more);
    print_json(out);
  } else {
    print_text(found, files);
  }
  return saved ? kOk : kQuality;
}

// Shows the user what a camera sees: small pictures and a short text about light and framing.

inline constexpr int kPreviewWidth = 960;
inline constexpr double kBrightPart = 0.99;

inline float light_at(const calib::CameraPicture& picture, int x, int y, int channel) {
  const auto channels = static_cast<size_t>(picture.channels);
  const size_t pixel =
      static_cast<size_t>(y) * static_cast<size_t>(picture.width) + static_cast<size_t>(x);
  return picture.light[pixel * channels + std::min(static_cast<size_t>(channel), channels - 1)];
}

/// Writes the picture as a PNG in sRGB.
inline void write_picture(const calib::CameraPicture& picture, const std::string& file) {
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

/// Takes one picture and writes it, at most 960 pixels wide. Returns false if no picture came
/// within a second. Throws Error(Failed) if it cannot be written.
inline bool write_preview(calib::Camera& camera, const std::string& file) {
  calib::CameraPicture picture;
  if (camera.grab(picture, std::chrono::seconds(1)) != calib::GrabStatus::Ready) return false;
  write_picture(picture, file);
  return true;
}

/// Returns "brightest 71 %, clipped 0.0 %": percent of full scale, and the clipped part of the
/// picture.
[[nodiscard]] inline std::string light_of(const calib::CameraPicture& picture) {
  const std::vector<float>& light = picture.light;
  if (light.empty()) return "no light measured";
  const auto clipped =
      std::ranges::count_if(light, [](float v) { return v >= calib::kSaturatedLight; });
  return fmt::format("brightest {:.0f} % of full scale, clipped {:.1f} % of the picture",
                     100.0 * double{quantile(light, kBrightPart)},
                     100.0 * static_cast<double>(clipped) / static_cast<double>(light.size()));
}

}  // namespace lenticule::tools
