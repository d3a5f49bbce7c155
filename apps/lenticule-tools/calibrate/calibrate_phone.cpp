// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate phone shows the photo chart, waits for photographs that a phone takes of it
// by hand, and calibrates as soon as they are enough.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate.h"
#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule-tools/calibrate/hand_held_photos.h"
#include "apps/lenticule-tools/calibrate/photo_arrivals.h"
#include "apps/lenticule-tools/calibrate/photo_pack.h"
#include "apps/lenticule/cli/content_flags.h"
#include "base/error.h"
#include "base/print.h"
#include "calib/photo/tag_chart.h"
#include "calib/report/report.h"
#include "display/display_sink.h"
#include "display/open/open_display.h"
#include "frames/image_io.h"
#include "optics/model.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct PhoneFlags {
  std::string folder;
  std::string rig;
  std::string display = "kms";
  std::string pack;
  std::optional<double> focal_px;
  int least = 4;  ///< the fourth shows whether sheet or phone moved between the others
  int most = 10;
  double minutes = 10.0;
  double seconds = 20.0;
  bool existing = false;
  bool allow_inexact = false;
  ResultFlags result;
};

/// Returns a picture that is white for the eyes on one side and black for the others. The border
/// between them passes over the whole panel at once if the rig is right.
frames::WovenFrame two_sides(const optics::Rig& rig) {
  constexpr int kStep = 8;  // the phase is straight over so few pixels
  constexpr double kArmsLengthMm = 700.0;
  const optics::OpticalModel model(rig);
  const optics::Panel& panel = rig.panel;
  const double z = rig.viewing.distance.value;
  const optics::Eye eye{0.0, rig.viewing.height.value, std::isfinite(z) ? z : kArmsLengthMm};
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  for (int j = 0; j < panel.height_px; ++j)
    for (int c = 0; c < 3; ++c)
      for (int left = 0; left < panel.width_px; left += kStep) {
        const Vec2 at = panel.subpixel_centre_px(left, j, c);
        const double here = model.phase(at.x, at.y, c, eye);
        const double slope = (model.phase(at.x + kStep, at.y, c, eye) - here) / kStep;
        for (int i = left; i < std::min(left + kStep, panel.width_px); ++i) {
          const double phase = here + slope * (i - left);
          frame.row(j)[3 * static_cast<ptrdiff_t>(i) + c] = phase < std::round(phase) ? 255 : 0;
        }
      }
  return frame;
}

/// Returns "kiosk.check.png" for "kiosk.toml".
std::string picture_beside(const std::string& rig_file) {
  fs::path name(rig_file);
  name.replace_extension(".check.png");
  return name.string();
}

void show_frame(display::DisplaySink& sink, const frames::WovenFrame& frame) {
  if (sink.show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
    throw Error(ErrorKind::Device, "display: the chart was not displayed");
}

/// Lets the display work for a moment. Throws Error(Device) if it was disconnected.
void pause(display::Display& display) {
  const auto event =
      display.wait_event(display.now() + std::chrono::milliseconds(200), player::interrupt_fd());
  if (event.kind == display::EventKind::Lost)
    throw Error(ErrorKind::Device, "display: disconnected", "connect it again");
}

/// Collection shows the chart and takes photographs of it until they are enough, too many or too
/// late.
class Collection {
 public:
  Collection(const PhoneFlags& flags, const optics::Rig& rig, display::Display& display,
             display::DisplaySink& sink)
      : flags_(flags),
        display_(display),
        sink_(sink),
        photos_(rig, flags.focal_px),
        arrivals_(flags.folder, flags.existing) {
    show_frame(sink_, calib::draw_single_photo_chart(photos_.chart()));
  }

  /// Returns nothing if the user interrupts.
  std::optional<calib::Calibration> run() {
    const auto patience = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(60.0 * flags_.minutes));
    Clock::time_point last = Clock::now();
    while (taken_ < flags_.most && Clock::now() - last < patience) {
      pause(display_);
      const std::vector<fs::path> files = arrivals_.arrived();
      for (const fs::path& file : files) {
        if (player::interrupted()) return std::nullopt;
        take(file);
      }
      if (player::interrupted()) return std::nullopt;
      if (files.empty()) continue;
      last = Clock::now();
      if (photos_.usable() < static_cast<size_t>(flags_.least)) continue;
      calib::Calibration found = photos_.calibrate();
      if (found.verdict == calib::Verdict::Intrinsic) return found;
      for (const std::string& reason : found.reasons) say("not yet: {}\n", reason);
    }
    return photos_.calibrate();
  }

  [[nodiscard]] const HandHeldPhotos& photos() const { return photos_; }

 private:
  /// Measures a photograph and reports whether it can be used.
  void take(const fs::path& file) {
    const std::string name = file.filename().string();
    say("{}: measuring\n", name);
    ++taken_;
    try {
      const std::string refusal = photos_.add(file);
      say("{}: {}\n", name, refusal.empty() ? "good" : "not used: " + refusal);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Input) throw;
      say("{}: not used: {}; let the phone store JPEG files\n", name, error.what());
    }
    if (!planned_again_) plan_again();
  }

  void plan_again() {
    const auto better = photos_.better_start();
    if (!better) return;
    say("the pitch is {:.3f} subpixels, far from the start's {:.3f}: the chart has changed; take "
        "all photographs again\n",
        better->sheet.pitch.value, photos_.chart().start.sheet.pitch.value);
    photos_ = HandHeldPhotos(*better, flags_.focal_px);
    show_frame(sink_, calib::draw_single_photo_chart(photos_.chart()));
    planned_again_ = true;
    taken_ = 0;
  }

  const PhoneFlags& flags_;
  display::Display& display_;
  display::DisplaySink& sink_;
  HandHeldPhotos photos_;
  PhotoArrivals arrivals_;
  int taken_ = 0;
  bool planned_again_ = false;
};

ExitCode run_phone(const PhoneFlags& flags) {
  const optics::Rig rig = optics::load_trimmed_rig(flags.rig);
  display::DisplayRequest request = display::request_for(rig, flags.display);
  request.kms.allow_inexact = flags.allow_inexact;
  const auto display = display::open_display(request);
  display::DisplaySink sink(*display);
  Collection collection(flags, rig, *display, sink);
  say("1. Photograph the whole panel from the middle with the phone turned upside down; then, the\n"
      "   usual way up and held high, from a step to the left and a step to the right; there once\n"
      "   more upside down. No zoom.\n"
      "2. Send the photographs as the phone stored them to {}\n"
      "3. Wait: each is measured as it arrives. Ctrl-C ends.\n",
      flags.folder);
  const auto found = collection.run();
  if (!found) return player::interrupt_exit_code();
  ResultFlags result = flags.result;
  std::optional<frames::WovenFrame> check;
  if (found->verdict != calib::Verdict::Refused) {
    check = two_sides(found->rig);
    result.picture = picture_beside(result.output);
    frames::write_woven(check->view(), result.picture);
  }
  const ExitCode code = conclude_calibration(*found, collection.photos().details(), result);
  if (!flags.pack.empty())
    write_photo_pack({.sources = collection.photos().files(),
                      .start = collection.photos().chart().start,
                      .focal_px = flags.focal_px,
                      .distances_mm = {},
                      .report = calib::report_json(*found, collection.photos().details())},
                     flags.pack);
  if (!check) return code;
  if (!result.json)
    print_out("Every eye of the viewing zone sees its view to {:.3f} lens (95 % confidence).\n",
              found->drift.worst_lenses);
  show_frame(sink, *check);
  say("move your head sideways: the whole panel turns from white to black at once\n");
  const Clock::time_point end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                                   std::chrono::duration<double>(flags.seconds));
  while (!player::interrupted() && Clock::now() < end) pause(*display);
  return code;
}

}  // namespace

CalibrateWay declare_calibrate_phone(CLI::App& app) {
  const auto flags = std::make_shared<PhoneFlags>();
  CLI::App* way = app.add_subcommand(
      "phone", "show a chart and measure the sheet from photographs that a phone takes by hand");
  way->footer(
      "Example, for a phone that sends its photographs to the folder inbox:\n"
      "  lenticule calibrate phone inbox --rig start.toml --display kms -o kiosk.toml\n"
      "Photographs that are already there: lenticule calibrate photos 1.jpg 2.jpg 3.jpg 4.jpg");
  way->add_option("FOLDER", flags->folder, "folder in which the photographs arrive")->required();
  cli::declare_rig_flag(*way, flags->rig, "rig file to start from");
  way->add_option("--display", flags->display, "kms, kms:CONNECTOR, or virtual")
      ->type_name("DISPLAY")
      ->capture_default_str();
  way->add_flag("--allow-inexact", flags->allow_inexact,
                "with kms: show the chart even if subpixels are known to arrive changed");
  way->add_option("--focal-px", flags->focal_px, "focal length in pixels of the photographs")
      ->type_name("PIXELS")
      ->default_str("as their EXIF data state")
      ->check(CLI::PositiveNumber);
  way->add_flag("--existing", flags->existing,
                "also use photographs that are in the folder already");
  way->add_option("--least", flags->least, "number of usable photographs before the first attempt")
      ->check(CLI::Range(2, 20))
      ->capture_default_str();
  way->add_option("--most", flags->most, "number of photographs after which the command gives up")
      ->check(CLI::Range(2, 20))
      ->capture_default_str();
  way->add_option("--minutes", flags->minutes, "how long to wait for the next photograph")
      ->type_name("MINUTES")
      ->check(CLI::Range(0.01, 1440.0))
      ->capture_default_str();
  way->add_option("--seconds", flags->seconds, "how long to show the result on the display")
      ->type_name("SECONDS")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  declare_pack_flag(*way, flags->pack);
  declare_result_flags(*way, flags->result);
  return {.app = way, .run = [flags] {
            flags->rig = player::choose_rig({.given = flags->rig, .display = flags->display}).file;
            return run_phone(*flags);
          }};
}

}  // namespace lenticule::tools
