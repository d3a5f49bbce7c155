// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate photos calibrates from photographs: one photograph of the photo chart,
// several of it by hand, or folders with photographs of all patterns. lenticule calibrate phone
// shows that chart and waits for the photographs.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule-tools/calibrate/hand_held_photos.h"
#include "apps/lenticule/cli/content_flags.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "calib/fit/calibrate.h"
#include "calib/photo/photo_folder.h"
#include "calib/photo/single_photo.h"
#include "calib/photo/tag_chart.h"
#include "calib/report/report.h"
#include "frames/image_io.h"
#include "optics/model.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {

namespace {

namespace fs = std::filesystem;

struct PhotosFlags {
  std::vector<std::string> sources;
  std::string rig;
  std::string write_patterns;
  std::string patterns;
  std::string pack;
  std::vector<double> distances_mm;  ///< distances of the first sources from the panel
  std::optional<double> focal_px;
  double most_lenses = 0.0;
  ResultFlags result;
};

ExitCode write_patterns(const PhotosFlags& flags, const optics::Rig& rig) {
  const std::vector<calib::Pattern> patterns = calib::photo_patterns(rig);
  fs::create_directories(flags.write_patterns);
  // An interrupted run may leave patterns of two rigs, so the old manifest must not remain valid.
  std::error_code absent;
  fs::remove(fs::path(flags.write_patterns) / calib::kPatternManifest, absent);
  player::Progress progress("writing", "patterns", patterns.size());
  frames::WovenFrame frame;
  for (size_t n = 0; n < patterns.size() && !player::interrupted(); ++n) {
    calib::draw_pattern(patterns[n], rig.panel, frame);
    frames::write_woven(frame.view(), fmt::format("{}/{:03}.png", flags.write_patterns, n));
    progress.update(n + 1);
  }
  progress.finish();
  if (player::interrupted()) return player::interrupt_exit_code();
  calib::write_manifest(calib::manifest_of(rig, patterns.size()), flags.write_patterns);
  if (flags.result.json)
    print_json({{"folder", flags.write_patterns}, {"patterns", patterns.size()}});
  else
    print_out(
        "{}: {} patterns. Show each full-screen (lenticule play), photograph it from the same\n"
        "place with everything on manual, and give the folder of photographs to calibrate "
        "photos.\n",
        flags.write_patterns, patterns.size());
  return kOk;
}

constexpr double kTapeSigmaMm = 5.0;  ///< standard error of a distance measured with a tape
constexpr double kMostPull = 2.5;     ///< standard errors

// Returns priors for the given values. A data sheet's focal length is accurate to two percent.
calib::PhotoPriors priors_of(const PhotosFlags& flags) {
  calib::PhotoPriors priors;
  if (!flags.distances_mm.empty())
    priors.distance_mm = calib::Estimate{flags.distances_mm.front(), kTapeSigmaMm};
  if (flags.focal_px) priors.focal_px = calib::Estimate{*flags.focal_px, 0.02 * *flags.focal_px};
  return priors;
}

/// Ends the calibration, and packs the photographs if that is wanted.
ExitCode conclude(const PhotosFlags& flags, const optics::Rig& start,
                  const calib::Calibration& found, const calib::RecordDetails& details,
                  const nlohmann::json& more = nlohmann::json::object()) {
  const ExitCode code = conclude_calibration(found, details, flags.result, more);
  if (!flags.pack.empty())
    write_photo_pack({.sources = {flags.sources.begin(), flags.sources.end()},
                      .start = start,
                      .focal_px = flags.focal_px,
                      .distances_mm = flags.distances_mm,
                      .report = calib::report_json(found, details)},
                     flags.pack);
  return code;
}

ExitCode from_one(const PhotosFlags& flags, const optics::Rig& rig) {
  const calib::SinglePhotoChart chart = calib::plan_single_photo_chart(rig);
  const calib::CameraPicture photograph = calib::read_photograph(flags.sources.front());
  const calib::Calibration found = calib::fit_single_photo(photograph, chart, priors_of(flags));
  const calib::CameraFacts camera{.name = fs::path(flags.sources.front()).filename(),
                                  .width = photograph.width,
                                  .height = photograph.height,
                                  .channels = photograph.channels,
                                  .pixel_format = "photograph"};
  nlohmann::json more = nlohmann::json::object();
  if (flags.result.json && found.verdict == calib::Verdict::Refused) {
    HandHeldPhotos photos(rig, flags.focal_px);  // among several, it may count
    (void)photos.add(flags.sources.front());
    more["photographs"] = photos.to_json({});
  }
  return conclude(flags, rig, found, {.method = "one photograph", .camera = camera}, more);
}

/// Calibrates from several photographs of the photo chart, taken by hand from different places, or
/// from a film.
ExitCode from_several(const PhotosFlags& flags, const optics::Rig& rig) {
  HandHeldPhotos photos(rig, flags.focal_px);
  if (is_film(flags.sources.front())) {
    if (!flags.distances_mm.empty()) throw usage_error("--distance: a film is taken from many");
    if (!photos.add_film(flags.sources.front())) return player::interrupt_exit_code();
  } else {
    player::Progress progress("measuring", "photographs", flags.sources.size());
    // The result names the photographs that cannot be used.
    photos.add_all({flags.sources.begin(), flags.sources.end()}, [&](size_t added) {
      progress.update(added);
      return !player::interrupted();
    });
    if (player::interrupted()) return player::interrupt_exit_code();
    progress.finish();
  }
  calib::Calibration found = photos.calibrate(flags.most_lenses);
  if (!flags.distances_mm.empty() && !found.viewpoints.empty() &&
      found.viewpoints[0].name == fs::path(flags.sources[0]).filename()) {
    const calib::Viewpoint& first = found.viewpoints[0];
    const double taped = flags.distances_mm[0], off = first.eye_mm.z - taped;
    if (std::abs(off) > kMostPull * std::hypot(kTapeSigmaMm, first.eye_sigma_mm.z))
      found.warnings.push_back(fmt::format(
          "{} was taken from {:.0f} mm by the rig's panel size, not from {:.0f} mm: measure the "
          "panel, its size in the rig seems {:+.1f} % off",
          first.name, first.eye_mm.z, taped, 100.0 * off / taped));
  }
  if (const auto better = photos.better_start(); better && found.verdict == calib::Verdict::Refused)
    found.reasons.push_back(
        fmt::format("the pitch is {:.3f} subpixels, far from the start's: write it into the rig, "
                    "show the chart again, and take everything again",
                    better->sheet.pitch.value));
  return conclude(flags, rig, found, photos.details(),
                  {{"photographs", photos.to_json(found)}, {"film", photos.film()}});
}

/// Looks for a manifest among the photographs, then in the folder of the patterns. Returns false if
/// there is none. Throws Error(Input) if it belongs to another rig.
bool manifest_agrees(const PhotosFlags& flags, const std::string& folder, const optics::Rig& rig) {
  for (const std::string& place : {folder, flags.patterns}) {
    if (place.empty()) continue;
    const std::optional<calib::PatternManifest> manifest = calib::read_manifest(place);
    if (!manifest) continue;
    calib::check_manifest(*manifest, rig, place);
    return true;
  }
  return false;
}

/// Checks the rig: by the marks in the photographs, or by the manifest if they are not readable.
void require_known_rig(calib::ViewpointMeasurement& measured, bool manifest_agrees,
                       const std::string& folder) {
  if (measured.rig_code_read) return;
  if (!manifest_agrees)
    throw input_error(
        "{}: unknown for which rig these patterns were written: no code is "
        "readable beside the marks, and there is no {}",
        folder, calib::kPatternManifest)
        .remedy(
            "give the folder that --write-patterns wrote as --patterns; without a manifest, "
            "write the patterns and photograph them again");
  measured.warnings.emplace_back(
      "no code is readable beside the marks: only the manifest states that the patterns belong to "
      "this rig");
}

ExitCode from_folders(const PhotosFlags& flags, const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  const size_t wanted = calib::photo_patterns(rig).size();
  std::vector<calib::ViewpointMeasurement> measured;
  calib::CameraFacts camera;
  for (const std::string& folder : flags.sources) {
    // A photograph that is missing is named when it is its turn.
    calib::PhotoFolder photographs(folder, wanted, wanted / 2);
    frames::NullSink nowhere(rig.panel.width_px, rig.panel.height_px);
    const bool known = manifest_agrees(flags, folder, rig);
    const std::string name = photographs.facts().name;
    player::Progress progress(name, "photographs", wanted);
    uint64_t read = 0;
    calib::CaptureOptions capture;
    capture.average = 1;
    capture.clocked = false;
    capture.most_dropped = 0;
    measured.push_back(calib::measure_viewpoint(
        nowhere, photographs, model, capture,
        {.name = name, .link_and_spot = false, .adaptive = false}, [&](const calib::Pattern&) {
          progress.update(read++);
          return !player::interrupted();
        }));
    progress.finish();
    require_known_rig(measured.back(), known, folder);
    for (const uint64_t number : measured.back().doubles)
      measured.back().warnings.push_back(
          fmt::format("{} shows the same pattern as the photograph before it and was not used",
                      photographs.files()[number].filename().string()));
    camera = photographs.facts();
  }
  calib::CalibrateOptions options;
  for (const double distance : flags.distances_mm)
    options.distances_mm.push_back({distance, kTapeSigmaMm});
  options.focal_px = priors_of(flags).focal_px;
  return conclude(flags, rig, calib::calibrate(measured, rig, options),
                  {.method = "photographs", .camera = camera});
}

ExitCode run_photos(const PhotosFlags& flags) {
  const bool files = std::ranges::none_of(
      flags.sources, [](const std::string& source) { return fs::is_directory(source); });
  const optics::Rig rig = optics::load_trimmed_rig(flags.rig);
  if (flags.distances_mm.size() > (files ? 1 : flags.sources.size()))
    throw Error(ErrorKind::Usage, "--distance: more distances than places",
                "give one distance for each folder, in their order, separated by commas");
  if (!flags.write_patterns.empty()) return write_patterns(flags, rig);
  if (flags.sources.empty() || flags.result.output.empty())
    throw Error(ErrorKind::Usage, "calibrate photos: photographs and -o are needed",
                "or use --write-patterns FOLDER to get the patterns to photograph");
  if (!files) return from_folders(flags, rig);
  const bool film = std::ranges::any_of(flags.sources, is_film);
  if (film && flags.sources.size() > 1)
    throw Error(ErrorKind::Usage, "calibrate photos: a film is not mixed with other files",
                "give one film alone, or only photographs");
  return flags.sources.size() == 1 && !film ? from_one(flags, rig) : from_several(flags, rig);
}

}  // namespace

CalibrateWay declare_calibrate_photos(CLI::App& app) {
  const auto flags = std::make_shared<PhotosFlags>();
  CLI::App* way = app.add_subcommand("photos",
                                     "measure the sheet from photographs of the photo chart, a "
                                     "film of it, or folders of patterns")
                      ->group(kWithCamera);
  way->footer(
      "Example, with one photograph, good for the eye that it was taken from:\n"
      "  lenticule calibrate show photo-chart --rig start.toml --display kms\n"
      "  lenticule calibrate photos IMG_0001.jpg --rig start.toml -o kiosk.toml --distance 700\n"
      "Four photographs of that chart from the hand, good for every eye: from the middle with the\n"
      "phone upside down, from the upper left and right the usual way up, and there upside down:\n"
      "  lenticule calibrate photos 1.jpg 2.jpg 3.jpg 4.jpg --rig start.toml -o kiosk.toml\n"
      "All patterns, from three places, one folder each:\n"
      "  lenticule calibrate photos --rig start.toml --write-patterns patterns\n"
      "  lenticule calibrate photos centre left right --rig start.toml -o kiosk.toml");
  way->add_option("PHOTOS", flags->sources, "a photograph, a film, or a folder for each viewpoint");
  cli::declare_rig_flag(*way, flags->rig, "rig file to start from");
  cli::add_option(*way, "--write-patterns FOLDER", flags->write_patterns,
                  "folder to write all patterns to, with a manifest; nothing else is done");
  cli::add_option(
      *way, "--patterns FOLDER", flags->patterns,
      "folder that --write-patterns wrote; needed if the photographs do not show their rig");
  cli::add_option(*way, "--distance MM", flags->distances_mm,
                  "distance from the panel to the camera of the first photograph\n"
                  "Without it a single photograph is less exact. For folders one number each, "
                  "separated by commas.")
      ->delimiter(',')
      ->check(CLI::Range(1.0, 1e6))
      ->allow_extra_args(false);
  cli::add_option(*way, "--focal-px PIXELS", flags->focal_px,
                  "focal length in pixels of the photograph, if known\n"
                  "It is used like --distance.")
      ->check(CLI::Range(1.0, 1e6));
  cli::add_option(*way, "--largest-error LENSES", flags->most_lenses,
                  "largest stated error with which a rig is written\n"
                  "Of a rig from several photographs by hand.")
      ->default_str("0.02")
      ->check(CLI::Range(0.02, 0.5));
  declare_pack_flag(*way, flags->pack);
  declare_result_flags(*way, flags->result);
  way->get_option("--output")->required(false);
  return {.app = way, .run = [flags] {
            flags->rig = player::choose_rig({.given = flags->rig}).file;
            return run_photos(*flags);
          }};
}

// lenticule calibrate phone shows the photo chart, waits for photographs that a phone takes of it
// by hand, and calibrates as soon as they are enough.

namespace {

using Clock = std::chrono::steady_clock;

struct PhoneFlags : DisplayFlags {
  std::string folder;
  std::string rig;
  std::string pack;
  std::optional<double> focal_px;
  int least = 4;  ///< the fourth shows whether sheet or phone moved between the others
  int most = 10;
  double minutes = 10.0;
  double seconds = 20.0;
  bool existing = false;
  ResultFlags result;
};

/// Returns a picture that is white for the eyes on one side and black for the others. The border
/// between them passes over the whole panel at once if the rig is right.
frames::WovenFrame two_sides(const optics::Rig& rig) {
  constexpr int kStep = 8;  // the phase is straight over so few pixels
  const optics::OpticalModel model(rig);
  const optics::Panel& panel = rig.panel;
  const optics::Eye eye{0.0, rig.viewing.height.value, calib::viewing_distance_mm(rig)};
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

/// Collection shows the chart and takes photographs of it until they are enough, too many or too
/// late.
class Collection {
 public:
  Collection(const PhoneFlags& flags, const optics::Rig& rig, PatternDisplay& panel)
      : flags_(flags),
        panel_(panel),
        photos_(rig, flags.focal_px),
        arrivals_(flags.folder, flags.existing) {
    panel_.show(calib::draw_single_photo_chart(photos_.chart()));
  }

  /// Returns nothing if the user interrupts.
  std::optional<calib::Calibration> run() {
    const auto patience = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(60.0 * flags_.minutes));
    Clock::time_point last = Clock::now();
    while (taken_ < flags_.most && Clock::now() - last < patience) {
      panel_.pause();
      for (const fs::path& file : arrivals_.arrived()) {
        if (player::interrupted()) return std::nullopt;
        last = Clock::now();
        if (!take(file) || (photos_.usable() < 2 && !photos_.is_film())) continue;
        calib::Calibration found = photos_.calibrate();
        if (is_enough(found)) return found;
      }
      if (player::interrupted()) return std::nullopt;
    }
    return photos_.calibrate();
  }

  [[nodiscard]] const HandHeldPhotos& photos() const { return photos_; }

 private:
  /// Says which photographs do not count, the errors that the fits stated so far, and what is
  /// missing. Returns true if nothing is.
  bool is_enough(const calib::Calibration& found) {
    for (const calib::SetAside& one : found.set_aside)
      say("{}: set aside: {}\n", one.photograph, one.reason);
    const size_t count = found.viewpoints.size();
    if (HandHeldPhotos::agree(found)) {
      errors_ +=
          fmt::format("{}{:.3f}", errors_.empty() ? "" : ", then ", found.drift.worst_lenses);
      say("{} {} count; error anywhere in the viewing zone: {} lens\n", count,
          photos_.is_film() ? "frames" : "photographs", errors_);
    }
    for (const std::string& reason : found.reasons) say("not yet: {}\n", reason);
    if (found.verdict != calib::Verdict::Intrinsic) return false;
    if (photos_.is_film() || count >= static_cast<size_t>(flags_.least)) return true;
    constexpr size_t kFew = 3;  // for which the last warning is that the sheet may have moved
    say("not yet: {}\n", count <= kFew ? found.warnings.back() : "take one more");
    return false;
  }
  /// Measures a photograph, and reports and returns whether it can be used.
  bool take(const fs::path& file) {
    const std::string name = file.filename().string();
    say("{}: measuring\n", name);
    ++taken_;
    bool good = false;
    const bool film = is_film(file);
    if (film && photos_.usable() > 0 && !photos_.is_film()) {  // of a photograph that moves
      say("{}: not used: a film is fitted alone, and photographs count already; move them out of "
          "the folder, or start again with the film alone\n",
          name);
      return false;
    }
    if (!film && photos_.is_film()) start_again(photos_.chart().start);
    try {
      if (film) {
        HandHeldPhotos alone(photos_.chart().start, flags_.focal_px);
        good = alone.add_film(file) && alone.film_refusal().empty();
        if (good)
          photos_ = std::move(alone);
        else if (!alone.film_refusal().empty())
          say("not used: {}\n", alone.film_refusal());
      } else {
        const std::string refusal = photos_.add(file);
        good = refusal.empty();
        say("{}: {}\n", name, good ? "good" : "not used: " + refusal);
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::Input) throw;
      say("{}: not used: {}{}\n", name, error.what(),
          film ? "" : "; let the phone store JPEG files");
    }
    if (good && !planned_again_ && (film || photos_.usable() == 1)) plan_again();
    return good;
  }
  void start_again(const optics::Rig& start) {
    photos_ = HandHeldPhotos(start, flags_.focal_px);
    errors_.clear();
  }

  void plan_again() {
    const auto better = photos_.better_start();
    if (!better) return;
    say("the pitch is {:.3f} subpixels, far from the start's {:.3f}: the chart has changed; take "
        "everything again\n",
        better->sheet.pitch.value, photos_.chart().start.sheet.pitch.value);
    start_again(*better);
    panel_.show(calib::draw_single_photo_chart(photos_.chart()));
    planned_again_ = true;
    taken_ = 0;
  }

  const PhoneFlags& flags_;
  PatternDisplay& panel_;
  HandHeldPhotos photos_;
  PhotoArrivals arrivals_;
  int taken_ = 0;
  bool planned_again_ = false;
  std::string errors_;  ///< stated by fits whose photographs agree, lenses
};

ExitCode run_phone(const PhoneFlags& flags) {
  // The chart was shown before. Reading a film that is not there names it.
  if (is_film(flags.folder) || (player::kind_of_file(flags.folder) == player::SourceKind::Video &&
                                !fs::exists(flags.folder)))
    return run_photos({.sources = {flags.folder},
                       .rig = flags.rig,
                       .write_patterns = {},
                       .patterns = {},
                       .pack = flags.pack,
                       .distances_mm = {},
                       .focal_px = flags.focal_px,
                       .result = flags.result});
  const optics::Rig rig = optics::load_trimmed_rig(flags.rig);
  PatternDisplay panel(flags, rig);
  Collection collection(flags, rig, panel);
  say("1. Photograph the whole panel from the middle with the phone turned upside down; then, the\n"
      "   usual way up and held high, from a step to the left and a step to the right; there once\n"
      "   more upside down. No zoom.\n"
      "2. Send the photographs as the phone stored them to {}\n"
      "3. Wait: each is measured as it arrives. Ctrl-C ends.\n"
      "Or film the panel for ten seconds, while you move the phone from the upper left over the\n"
      "middle to the upper right, without video stabilisation and HDR, and send the film.\n",
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
  const HandHeldPhotos& photos = collection.photos();
  const ExitCode code =
      conclude_calibration(*found, photos.details(), result,
                           {{"photographs", photos.to_json(*found)}, {"film", photos.film()}});
  if (!flags.pack.empty())
    write_photo_pack({.sources = photos.files(),
                      .start = photos.chart().start,
                      .focal_px = flags.focal_px,
                      .distances_mm = {},
                      .report = calib::report_json(*found, photos.details())},
                     flags.pack);
  if (!check) return code;
  panel.show(*check);
  say("move your head sideways: the whole panel turns from white to black at once\n");
  if (flags.seconds > 0.0) panel.hold(flags.seconds);
  return code;
}

}  // namespace

CalibrateWay declare_calibrate_phone(CLI::App& app) {
  const auto flags = std::make_shared<PhoneFlags>();
  CLI::App* way =
      app.add_subcommand(
             "phone",
             "show a chart and measure the sheet from photographs that a phone takes by hand")
          ->group(kWithCamera);
  way->footer(
      "Example, for a phone that sends its photographs to the folder inbox:\n"
      "  lenticule calibrate phone inbox --rig start.toml --display kms -o kiosk.toml\n"
      "Photographs that are already there: lenticule calibrate photos 1.jpg 2.jpg 3.jpg 4.jpg\n"
      "A film instead, of the phone moved past the chart in ten seconds, from the upper left over\n"
      "the middle to the upper right; switch off the phone's video stabilisation and HDR video:\n"
      "  lenticule calibrate phone FILM.mp4 --rig start.toml -o kiosk.toml");
  way->add_option("FOLDER", flags->folder,
                  "folder in which the photographs or a film arrive, or a film")
      ->required();
  cli::declare_rig_flag(*way, flags->rig, "rig file to start from");
  declare_display_flags(*way, *flags);
  cli::add_option(*way, "--focal-px PIXELS", flags->focal_px,
                  "focal length in pixels of the photographs")
      ->default_str("as their EXIF data state")
      ->check(CLI::PositiveNumber);
  way->add_flag("--existing", flags->existing,
                "also use photographs that are in the folder already");
  cli::add_option(*way, "--least", flags->least,
                  "number of photographs that must count before the command ends")
      ->check(CLI::Range(2, 20));
  cli::add_option(*way, "--most", flags->most,
                  "number of photographs after which the command gives up")
      ->check(CLI::Range(2, 20));
  cli::add_option(*way, "--minutes MINUTES", flags->minutes,
                  "how long to wait for the next photograph")
      ->check(CLI::Range(0.01, 1440.0));
  cli::add_option(*way, "--seconds SECONDS", flags->seconds,
                  "how long to show the result on the display")
      ->check(CLI::NonNegativeNumber);
  declare_pack_flag(*way, flags->pack);
  declare_result_flags(*way, flags->result);
  return {.app = way, .run = [flags] {
            flags->rig = player::choose_rig({.given = flags->rig, .display = flags->display}).file;
            return run_phone(*flags);
          }};
}
}  // namespace lenticule::tools
