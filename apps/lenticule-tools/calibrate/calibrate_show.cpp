// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate show shows any of the patterns on a display, or writes it to a file.
#include <fmt/format.h>
#include <poll.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "apps/lenticule-tools/calibrate/calibrate.h"
#include "apps/lenticule/cli/content_flags.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/measure/viewpoint.h"
#include "calib/photo/tag_chart.h"
#include "display/display_sink.h"
#include "display/open/open_display.h"
#include "frames/image_io.h"
#include "optics/effective_sheet.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

using calib::Channels;
using calib::Pattern;
using frames::WovenFrame;

struct ShowFlags {
  std::string pattern;
  std::string rig;
  std::string display = "kms";
  std::string output;
  double phase = 0.0;
  double pitch_factor = 1.0;
  std::string channel = "all";
  double seconds = 0.0;
  bool allow_inexact = false;
  bool json = false;
};

struct Subject {
  const optics::OpticalModel& model;
  const ShowFlags& flags;
  Channels channels;

  /// Returns the pitch seen by an eye in the middle of the viewing line.
  [[nodiscard]] double pitch() const {
    return flags.pitch_factor * optics::effective_sheet(model.rig()).pitch.value;
  }
};

using MakePattern = Pattern (*)(const Subject& subject);

struct NamedPattern {
  const char* name;
  const char* what;
  MakePattern make;
};

Pattern flat(const Subject& subject, double light) {
  return {.shape = calib::Flat{{light, light, light}}, .channels = subject.channels};
}

Pattern wave(const Subject& subject, bool vertical) {
  const optics::Panel& panel = subject.model.rig().panel;
  return {.shape = calib::Wave{.vertical = vertical,
                               .period_px = (vertical ? panel.height_px : panel.width_px) / 8.0,
                               .phase = subject.flags.phase},
          .channels = subject.channels};
}

Pattern comb(const Subject& subject) {
  const optics::LensSheet& sheet = subject.model.rig().sheet;
  const double pitch = subject.pitch();
  return {.shape = calib::Comb{.phase = {.constant = sheet.offset.value,
                                         .per_px_x = 3.0 / pitch,
                                         .per_px_y = 3.0 * sheet.slant / pitch},
                               .place = subject.flags.phase,
                               .width = 0.25},
          .channels = subject.channels};
}

const std::vector<NamedPattern>& patterns() {
  static const std::vector<NamedPattern> table = {
      {"black", "no light: shows room light and reflections",
       [](const Subject& s) { return flat(s, 0.0); }},
      {"white", "full light: for framing and exposure",
       [](const Subject& s) { return flat(s, 1.0); }},
      {"fringes", "a sinusoid one lens wide: seen through the sheet, a few wide fringes",
       [](const Subject& s) {
         return Pattern{.shape = calib::Fringe{.pitch_subpx = s.pitch(),
                                               .slant = s.model.rig().sheet.slant,
                                               .phase = s.flags.phase},
                        .channels = s.channels};
       }},
      {"wave-x", "a wide horizontal sinusoid: shows which panel point is seen",
       [](const Subject& s) { return wave(s, false); }},
      {"wave-y", "the same, vertical", [](const Subject& s) { return wave(s, true); }},
      {"comb", "a quarter of each lens lit, at --phase: shows lens spot and crosstalk", comb},
      {"columns", "every other column of pixels: colours wash out on a 4:2:0 link",
       [](const Subject& s) { return Pattern{.shape = calib::Columns{}, .channels = s.channels}; }},
      {"checks", "squares of one pixel: bands appear where the panel scales",
       [](const Subject& s) { return Pattern{.shape = calib::Checks{}, .channels = s.channels}; }},
  };
  return table;
}

constexpr const char* kPhotoChart = "photo-chart";

std::vector<std::string> pattern_names() {
  std::vector<std::string> names;
  for (const NamedPattern& pattern : patterns()) names.emplace_back(pattern.name);
  names.emplace_back(kPhotoChart);
  return names;
}

WovenFrame draw(const ShowFlags& flags, const optics::OpticalModel& model) {
  if (flags.pattern == kPhotoChart)
    return calib::draw_single_photo_chart(calib::plan_single_photo_chart(model.rig()));
  Subject subject{model, flags, {}};
  const std::vector<std::string> names = {"red", "green", "blue"};
  const auto channel = std::ranges::find(names, flags.channel);
  if (channel != names.end())
    subject.channels = Channels::only(static_cast<int>(channel - names.begin()));
  const auto named = std::ranges::find_if(
      patterns(), [&](const NamedPattern& pattern) { return flags.pattern == pattern.name; });
  WovenFrame frame;
  calib::draw_pattern(named->make(subject), model.rig().panel, frame);
  return frame;
}

/// Waits until the time is over or the user interrupts.
void hold(display::Display& display, double seconds) {
  const display::Nanoseconds end = display.now() + std::chrono::duration_cast<display::Nanoseconds>(
                                                       std::chrono::duration<double>(seconds));
  while (!player::interrupted() && (seconds <= 0.0 || display.now() < end)) {
    const auto event =
        display.wait_event(display.now() + std::chrono::milliseconds(200), player::interrupt_fd());
    if (event.kind == display::EventKind::Lost)
      throw Error(ErrorKind::Device, "display: disconnected", "connect it again");
  }
}

ExitCode show_pattern(const ShowFlags& flags) {
  const optics::OpticalModel model(optics::load_trimmed_rig(flags.rig));
  const WovenFrame frame = draw(flags, model);
  if (!flags.output.empty()) {
    frames::write_woven(frame.view(), flags.output);
    if (flags.json)
      print_json({{"pattern", flags.pattern}, {"output", flags.output}});
    else
      print_out("{}: {}\n", flags.output, flags.pattern);
    return kOk;
  }
  display::DisplayRequest request = display::request_for(model.rig(), flags.display);
  request.kms.allow_inexact = flags.allow_inexact;
  const auto display = display::open_display(request);
  display::DisplaySink sink(*display);
  if (sink.show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
    throw Error(ErrorKind::Device, "display: the pattern was not displayed");
  say("{} on {}{}\n", flags.pattern, display->mode().name,
      flags.seconds > 0.0 ? "" : ", until Ctrl-C");
  hold(*display, flags.seconds);
  if (flags.json) print_json({{"pattern", flags.pattern}, {"display", display->mode().name}});
  return flags.seconds > 0.0 && player::interrupted() ? player::interrupt_exit_code() : kOk;
}

}  // namespace

CalibrateWay declare_calibrate_show(CLI::App& app) {
  const auto flags = std::make_shared<ShowFlags>();
  CLI::App* way = app.add_subcommand("show", "show a pattern on a display, or write it to a file");
  std::string help = "Patterns:\n";
  for (const NamedPattern& pattern : patterns())
    help += fmt::format("  {:<12} {}\n", pattern.name, pattern.what);
  help += fmt::format("  {:<12} fringes and tags for calibrate photos with a single photograph\n",
                      kPhotoChart);
  way->footer(help + "Example:\n  lenticule calibrate show fringes --display kms");
  way->add_option("PATTERN", flags->pattern, "name of the pattern, see below")
      ->required()
      ->check(CLI::IsMember(pattern_names()));
  cli::declare_rig_flag(*way, flags->rig);
  way->add_option("--display", flags->display, "kms, kms:CONNECTOR, or virtual")
      ->type_name("DISPLAY")
      ->capture_default_str();
  way->add_flag("--allow-inexact", flags->allow_inexact,
                "with kms: show patterns even if subpixels are known to arrive changed");
  way->add_option("-o,--output", flags->output, "write a picture instead: .png, .tif, .ppm")
      ->type_name("FILE");
  way->add_option("--phase", flags->phase, "phase of fringes and waves; of a comb, in lenses")
      ->type_name("TURNS")
      ->capture_default_str();
  way->add_option("--pitch-factor", flags->pitch_factor, "makes fringes wider by this factor")
      ->check(CLI::Range(0.1, 10.0))
      ->capture_default_str();
  way->add_option("--channel", flags->channel, "subpixels that show the pattern")
      ->check(CLI::IsMember({"all", "red", "green", "blue"}))
      ->capture_default_str();
  way->add_option("--seconds", flags->seconds, "how long to show it; 0: until Ctrl-C")
      ->type_name("SECONDS")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  way->add_flag("--json", flags->json, "print what was done as JSON");
  return {.app = way, .run = [flags] {
            const std::string display = flags->output.empty() ? flags->display : "";
            flags->rig = player::choose_rig({.given = flags->rig, .display = display}).file;
            return show_pattern(*flags);
          }};
}

}  // namespace lenticule::tools
