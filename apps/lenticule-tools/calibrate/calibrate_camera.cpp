// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate camera shows patterns on the panel and photographs them with a V4L2 camera
// from several viewpoints; lenticule calibrate show shows one pattern.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <memory>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/cameras/v4l2_camera.h"
#include "calib/fit/calibrate.h"
#include "calib/measure/viewpoint.h"
#include "calib/photo/tag_chart.h"
#include "frames/image_io.h"
#include "optics/rig.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {

namespace {

using nlohmann::json;

struct CameraFlags : DisplayFlags {
  std::string rig;
  calib::V4l2Options camera;
  bool list = false;
  int viewpoints = 3;
  bool no_prompts = false;
  int settle_ms = 150;
  int average = 3;
  double gap_tolerance = 0.5;
  std::string preview;
  ResultFlags result;
};

/// Positions for the camera, best first: unequal distances to the sides distinguish gaps that equal
/// distances do not.
struct Place {
  const char* name;
  const char* where;
};
constexpr std::array<Place, 5> kPlaces = {{
    {"centre", "in front of the panel's middle, where a viewer's eye will be"},
    {"left", "about 250 mm to the left of that, still aimed at the panel's middle"},
    {"right", "about 300 mm to the right of the first place, still aimed at the panel's middle"},
    {"near", "in front of the middle again, a quarter nearer"},
    {"high", "in front of the middle, 150 mm higher"},
}};

ExitCode list_all(bool as_json) {
  json all = json::array();
  for (const calib::CameraListing& camera : calib::list_cameras()) {
    json formats = json::array();
    for (const calib::FormatOffer& format : camera.formats)
      formats.push_back({{"pixel_format", format.pixel_format()},
                         {"usable", format.usable()},
                         {"sizes", format.size_names()}});
    all.push_back({{"path", camera.path},
                   {"stable_path", camera.stable_path},
                   {"name", camera.name},
                   {"bus", camera.bus},
                   {"formats", formats},
                   {"problem", camera.problem}});
  }
  if (as_json) {
    print_json(all);
    return kOk;
  }
  if (all.empty()) print_out("no camera found\n");
  for (const json& camera : all) {
    print_out("{}  {}  {}\n", camera["path"].get<std::string>(), camera["name"].get<std::string>(),
              camera["stable_path"].get<std::string>());
    if (!camera["problem"].get<std::string>().empty())
      print_out("  {}\n", camera["problem"].get<std::string>());
    for (const json& format : camera["formats"])
      print_out(
          "  {}{}: {}\n", format["pixel_format"].get<std::string>(),
          format["usable"].get<bool>() ? "" : " (not usable)",
          fmt::format("{}", fmt::join(format["sizes"].get<std::vector<std::string>>(), ", ")));
  }
  return kOk;
}

/// Returns a white picture with marks, which show where the panel is.
frames::WovenFrame white_frame(const optics::Rig& rig) {
  const calib::Pattern white{.shape = calib::Flat{{1.0, 1.0, 1.0}}, .channels = {}, .mark = 3};
  frames::WovenFrame frame;
  calib::draw_pattern(white, rig.panel, frame);
  return frame;
}

class CameraRun {
 public:
  explicit CameraRun(const CameraFlags& flags)
      : flags_(flags), model_(optics::load_trimmed_rig(flags.rig)) {
    panel_ = std::make_unique<PatternDisplay>(flags, model_.rig());
    calib::V4l2Options options = flags.camera;
    options.refresh_hz = panel_->device().mode().refresh.hertz();
    camera_ = calib::open_v4l2_camera(options);
    for (const std::string& unlocked : camera_->facts().unlocked) say("camera: {}\n", unlocked);
  }

  ExitCode run() {
    std::vector<calib::ViewpointMeasurement> measured;
    for (int v = 0; v < flags_.viewpoints; ++v) {
      const Place& place = kPlaces[static_cast<size_t>(v)];
      panel_->show(white_frame(model_.rig()));
      if (!flags_.no_prompts) wait_for_person(place, v);
      if (player::interrupted()) return player::interrupt_exit_code();
      measured.push_back(measure(place, v));
      report(measured.back());
    }
    const calib::RecordDetails details{.method = "camera", .camera = camera_->facts()};
    panel_.reset();  // before the computation
    calib::CalibrateOptions options;
    options.gap_tolerance = flags_.gap_tolerance;
    return conclude_calibration(calib::calibrate(measured, model_.rig(), options), details,
                                flags_.result);
  }

 private:
  /// Waits for the user. Meanwhile the panel is white, and pictures of it show whether the camera
  /// and the light are right.
  void wait_for_person(const Place& place, int number) {
    say("\n"
        "Viewpoint {} of {}: put the camera {}.\n"
        "The picture must show the whole panel, which should nearly fill it. Then press enter.\n",
        number + 1, flags_.viewpoints, place.where);
    while (!player::interrupted() && !enter_pressed()) {
      calib::CameraPicture picture;
      const calib::GrabStatus status = camera_->grab(picture, std::chrono::seconds(1));
      if (status == calib::GrabStatus::Gone)
        throw Error(ErrorKind::Device, "camera: " + camera_->failure(),
                    "nothing was written; connect the camera again and start over");
      if (status != calib::GrabStatus::Ready) continue;
      if (!flags_.preview.empty()) write_picture(picture, flags_.preview);
      if (isatty(STDERR_FILENO) != 0) say("\r\x1b[K  {}", light_of(picture));
    }
    say("\n");
  }

  /// Waits half a second for the Enter key.
  static bool enter_pressed() {
    std::array<pollfd, 2> waiting = {
        {{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0},
         {.fd = player::interrupt_fd(), .events = POLLIN, .revents = 0}}};
    if (poll(waiting.data(), waiting.size(), 500) <= 0 || waiting[0].revents == 0) return false;
    std::array<char, 256> line{};
    const ssize_t got = read(STDIN_FILENO, line.data(), line.size());
    if (got != 0) return got > 0;
    throw Error(ErrorKind::Usage, "calibrate camera: standard input has ended",
                "run it in a terminal, or with --no-prompts");
  }

  calib::ViewpointMeasurement measure(const Place& place, int number) {
    const calib::MeasureOptions options{.name = place.name, .link_and_spot = number == 0};
    player::Progress progress(place.name, "patterns",
                              static_cast<uint64_t>(calib::pattern_count(options)));
    uint64_t shown = 0;
    const calib::CaptureProgress each = [&](const calib::Pattern&) {
      progress.update(shown++);
      if (shown % 16 == 0) check_controls();
      if (shown % 16 == 0 && !flags_.preview.empty()) write_preview(*camera_, flags_.preview);
      return !player::interrupted();
    };
    calib::CaptureOptions capture;
    capture.settle = std::chrono::milliseconds(flags_.settle_ms);
    capture.average = flags_.average;
    calib::ViewpointMeasurement measured =
        calib::measure_viewpoint(panel_->sink(), *camera_, model_, capture, options, each);
    progress.finish();
    return measured;
  }

  void check_controls() {
    const std::vector<std::string> drifted = camera_->drifted_controls();
    if (drifted.empty()) return;
    throw Error(ErrorKind::Device, "camera: " + drifted.front(),
                "another program may be changing the camera; close that program and start over");
  }

  static void report(const calib::ViewpointMeasurement& m) {
    say("  effective pitch {:.6f} subpixels, slant {:.6f}, contrast {:.0f} %, {:.0f} % of "
        "the panel, {} pictures late, {} unsettled, {} damaged\n",
        m.line.pitch_subpx(), m.line.slant(), 100.0 * m.contrast, 100.0 * m.covered, m.counts.late,
        m.counts.unsettled, m.counts.corrupt);
  }

  const CameraFlags& flags_;
  optics::OpticalModel model_;
  std::unique_ptr<PatternDisplay> panel_;
  std::unique_ptr<calib::Camera> camera_;
};

void declare_camera_flags(CLI::App& way, CameraFlags& flags) {
  way.option_defaults()->group("Camera");
  cli::add_option(way, "--device DEVICE", flags.camera.device,
                  "/dev/videoN or a name of /dev/v4l/by-id")
      ->default_str("the only camera");
  cli::add_option(way, "--width PIXELS", flags.camera.width, "width of the pictures; 0: near 1920");
  cli::add_option(way, "--height PIXELS", flags.camera.height, "height of the pictures");
  cli::add_option(way, "--fps RATE", flags.camera.frames_per_second, "pictures per second");
  cli::add_option(way, "--pixel-format FORMAT", flags.camera.pixel_format, "for example YUYV")
      ->default_str("the best for measuring");
  cli::add_option(way, "--exposure-periods REFRESHES", flags.camera.exposure_periods, "exposure")
      ->check(CLI::Range(1, 60));
  way.add_option("--gain", flags.camera.gain, "gain, in the camera's own units");
  way.option_defaults()->group("Options");
}

}  // namespace

CalibrateWay declare_calibrate_camera(CLI::App& app) {
  const auto flags = std::make_shared<CameraFlags>();
  CLI::App* way =
      app.add_subcommand("camera", "measure the sheet with a V4L2 camera at one or several places")
          ->group(kWithCamera);
  way->footer(
      "Darken the room, let the panel warm up for half an hour, use a tripod.\n"
      "Example:\n  lenticule calibrate camera --rig start.toml --display kms -o kiosk.toml");
  CLI::Option* rig = cli::declare_rig_flag(*way, flags->rig, "rig file to start from");
  declare_display_flags(*way, *flags);
  CLI::Option* list = way->add_flag("--list", flags->list, "list the cameras and exit");
  rig->excludes(list);
  declare_camera_flags(*way, *flags);
  way->option_defaults()->group("Measurement");
  cli::add_option(*way, "--viewpoints", flags->viewpoints,
                  "places of the camera; one place gives a rig for that eye only")
      ->check(CLI::Range(1, static_cast<int>(kPlaces.size())));
  way->add_flag("--no-prompts", flags->no_prompts, "do not wait for the enter key at each place");
  cli::add_option(*way, "--settle-ms MS", flags->settle_ms,
                  "time from a new pattern to its first picture")
      ->check(CLI::Range(0, 5000));
  cli::add_option(*way, "--average", flags->average, "number of pictures of each pattern")
      ->check(CLI::Range(1, 64));
  cli::add_option(*way, "--gap-tolerance", flags->gap_tolerance,
                  "relative tolerance of the starting gap")
      ->check(CLI::Range(0.01, 3.0));
  cli::add_option(*way, "--preview FILE", flags->preview,
                  "picture file that is updated with what the camera sees");
  declare_result_flags(*way, flags->result);
  way->get_option("--output")->required(false);
  return {.app = way, .run = [flags]() -> ExitCode {
            if (flags->list) return list_all(flags->result.json);
            if (flags->result.output.empty())
              throw Error(ErrorKind::Usage, "calibrate camera: -o is missing",
                          "see lenticule calibrate camera --help");
            flags->rig = player::choose_rig({.given = flags->rig, .display = flags->display}).file;
            return CameraRun(*flags).run();
          }};
}

// lenticule calibrate show shows the photo chart or a white picture on a display, or writes it to a
// file.

namespace {

struct ShowFlags : DisplayFlags {
  std::string pattern;
  std::string rig;
  std::string output;
  double seconds = 0.0;
  bool json = false;
};

frames::WovenFrame draw(const ShowFlags& flags, const optics::Rig& rig) {
  return flags.pattern == "white"
             ? white_frame(rig)
             : calib::draw_single_photo_chart(calib::plan_single_photo_chart(rig));
}

ExitCode show_pattern(const ShowFlags& flags) {
  const optics::Rig rig = optics::load_trimmed_rig(flags.rig);
  const frames::WovenFrame frame = draw(flags, rig);
  if (!flags.output.empty()) {
    frames::write_woven(frame.view(), flags.output);
    if (flags.json)
      print_json({{"pattern", flags.pattern}, {"output", flags.output}});
    else
      print_out("{}: {}\n", flags.output, flags.pattern);
    return kOk;
  }
  PatternDisplay panel(flags, rig);
  panel.show(frame);
  const std::string mode = panel.device().mode().name;
  say("{} on {}{}\n", flags.pattern, mode, flags.seconds > 0.0 ? "" : ", until Ctrl-C");
  panel.hold(flags.seconds);
  if (flags.json) print_json({{"pattern", flags.pattern}, {"display", mode}});
  return flags.seconds > 0.0 && player::interrupted() ? player::interrupt_exit_code() : kOk;
}

}  // namespace

CalibrateWay declare_calibrate_show(CLI::App& app) {
  const auto flags = std::make_shared<ShowFlags>();
  CLI::App* way = app.add_subcommand("show", "show a pattern on a display, or write it to a file")
                      ->group(kWithoutCamera);
  way->footer("Example:\n  lenticule calibrate show photo-chart --display kms");
  way->add_option("PATTERN", flags->pattern,
                  "photo-chart: fringes and tags for calibrate photos; white: for framing and "
                  "exposure")
      ->required()
      ->check(CLI::IsMember({"photo-chart", "white"}));
  cli::declare_rig_flag(*way, flags->rig);
  declare_display_flags(*way, *flags);
  cli::add_option(*way, "-o,--output FILE", flags->output,
                  "write a picture instead: .png, .tif, .ppm");
  cli::add_option(*way, "--seconds SECONDS", flags->seconds, "how long to show it; 0: until Ctrl-C")
      ->check(CLI::NonNegativeNumber);
  way->add_flag("--json", flags->json, "print what was done as JSON");
  return {.app = way, .run = [flags] {
            const std::string display = flags->output.empty() ? flags->display : "";
            flags->rig = player::choose_rig({.given = flags->rig, .display = display}).file;
            return show_pattern(*flags);
          }};
}
}  // namespace lenticule::tools
