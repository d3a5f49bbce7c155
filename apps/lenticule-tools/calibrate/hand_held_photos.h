// SPDX-License-Identifier: Apache-2.0
// HandHeldPhotos collects photographs of the photo chart that were taken by hand, or frames of a
// film, and calibrates from them; PhotoArrivals finds them in a folder, and a pack keeps them for a
// report of a fault.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule-tools/calibrate/film_frames.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/temporary.h"
#include "base/text.h"
#include "calib/phone/exif.h"
#include "calib/phone/film.h"
#include "calib/phone/phone_calibration.h"
#include "calib/photo/photo_folder.h"
#include "optics/rig.h"
#include "optics/rig_file.h"
#include "player/process/child_process.h"
#include "player/process/progress.h"

namespace lenticule::tools {

/// Thread safety: one thread.
class HandHeldPhotos {
 public:
  /// `focal_px` is the camera's focal length in pixels; without it, the photographs' EXIF data are
  /// used. Throws Error(Input) for a rig whose panel is too small for the chart.
  explicit HandHeldPhotos(const optics::Rig& rig, std::optional<double> focal_px = {})
      : chart_(calib::plan_single_photo_chart(rig)), given_focal_px_(focal_px) {}

  [[nodiscard]] const calib::SinglePhotoChart& chart() const { return chart_; }

  /// Measures a photograph. Returns the reason why it cannot be used, or an empty text. Throws
  /// Error(Input) for a file that is not a readable picture.
  std::string add(const std::filesystem::path& file) {
    files_.push_back(file);
    return keep(measure(file));
  }
  /// Measures photographs, two at once, and adds them in their order. Calls `goes_on` with the
  /// number of photographs added; stops when it returns false. Throws as add() does.
  void add_all(const std::vector<std::filesystem::path>& files,
               const std::function<bool(size_t)>& goes_on) {
    constexpr size_t kAtOnce = 2;  // 12 megapixels take a quarter of a gigabyte each
    std::deque<std::future<Measured>> waiting;
    size_t begun = 0;
    for (size_t n = 0; n < files.size(); ++n) {
      for (; begun < std::min(files.size(), n + kAtOnce); ++begun)
        waiting.push_back(
            std::async(std::launch::async, [this, &file = files[begun]] { return measure(file); }));
      files_.push_back(files[n]);
      keep(waiting.front().get());
      waiting.pop_front();
      if (!goes_on(n + 1)) return;
    }
  }

  /// Chooses frames of a film and measures them; there must be no photographs. Returns false if the
  /// user interrupted. Throws Error(Input) for a file that is not a readable film.
  bool add_film(const std::filesystem::path& file) {
    files_.push_back(file);
    is_film_ = true;
    const std::string name = file.filename().string();
    std::vector<calib::FilmFrame> seen;
    std::deque<std::future<Measured>> waiting;
    const auto locate_one = [&seen, &waiting] {
      seen[seen.size() - waiting.size()].found = waiting.front().get().photo.findings;
      waiting.pop_front();
    };
    player::Progress progress(name, "frames", 0);
    // A film with an uneven rate lacks numbers.
    const auto thinned = [&seen](uint64_t number, double hertz) {
      constexpr double kPerSecond = 10.0;
      return seen.empty() ||
             static_cast<double>(number - seen.back().number) >= std::round(hertz / kPerSecond);
    };
    if (!read_film(file, thinned,
                   [&, this](uint64_t number, double s, calib::CameraPicture picture) {
                     constexpr size_t kAtOnce = 2;
                     if (waiting.size() == kAtOnce) locate_one();
                     seen.push_back({.number = number, .seconds = s, .found = {}});
                     waiting.push_back(
                         std::async(std::launch::async, [this, &file, frame = std::move(picture)] {
                           return measure(frame, file, {}, true);
                         }));
                     progress.update(number);
                     return s <= calib::kLongestFilmSeconds;
                   }))
      return false;
    while (!waiting.empty()) locate_one();
    progress.finish();
    const calib::FilmChoice choice = calib::choose_frames(seen, chart_);
    film_ = {{"name", escaped(name)},
             {"frames", seen.size()},
             {"whole", choice.whole},
             {"sharp", choice.sharp},
             {"used_at_s", nlohmann::json::array()}};
    for (const auto& [index, motion] : choice.frames)
      film_["used_at_s"].push_back(seen[index].seconds);
    say("{}: {} frames looked at, {} show the whole chart, {} of them sharply; {} used\n", name,
        seen.size(), choice.whole, choice.sharp, choice.frames.size());
    if (!given_focal_px_) film_focal_px_ = choice.focal_px;
    film_refusal_ = choice.refusal.empty() ? "" : name + ": " + choice.refusal;
    auto next = choice.frames.begin();
    const auto chosen = [&](uint64_t number, double) {
      return next != choice.frames.end() && seen[next->frame].number == number;
    };
    if (choice.frames.empty()) return true;
    const bool whole =
        read_film(file, chosen, [&, this](uint64_t, double seconds, calib::CameraPicture picture) {
          Measured frame = measure(picture, file, fmt::format("{} at {:.2f} s", name, seconds));
          frame.photo.findings.motion = next->motion;
          keep(std::move(frame));
          return ++next != choice.frames.end();
        });
    if (whole && next != choice.frames.end())
      film_refusal_ = name + ": it gave other frames when it was read again";
    camera_.name = name;
    return whole;
  }
  /// Returns why the film cannot be used; empty if it can.
  [[nodiscard]] const std::string& film_refusal() const { return film_refusal_; }
  [[nodiscard]] bool is_film() const { return is_film_; }
  /// Returns how many frames of the film were looked at, sharp, and used; null without a film.
  [[nodiscard]] const nlohmann::json& film() const { return film_; }

  /// Returns the files so far, usable or not.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }
  [[nodiscard]] size_t usable() const {
    return static_cast<size_t>(std::ranges::count_if(
        photos_, [](const calib::PhonePhoto& photo) { return photo.findings.refusal.empty(); }));
  }
  /// Returns the rig from which to plan the chart again if the last photograph shows that the start
  /// is too far off; see calib::better_start().
  [[nodiscard]] std::optional<optics::Rig> better_start() const {
    if (photos_.empty()) return std::nullopt;
    return calib::better_start(photos_.back().findings, chart_);
  }
  /// Calibrates from all photographs so far; see calib::calibrate_phone() for `most_lenses`.
  [[nodiscard]] calib::Calibration calibrate(double most_lenses = 0.0) const {
    if (!film_refusal_.empty()) {
      calib::Calibration refused;
      refused.rig = chart_.start;
      refused.reasons = {film_refusal_};
      return refused;
    }
    // The median: one of another lens of the phone does not count.
    std::vector<calib::Estimate> focal_px = focal_px_;
    std::ranges::sort(focal_px, {}, &calib::Estimate::value);
    return calib::calibrate_phone(
        photos_, chart_, focal_px.empty() ? calib::Estimate() : focal_px[focal_px.size() / 2],
        most_lenses);
  }
  /// Returns in what a photograph contradicts the others; empty if it does not.
  static std::string doubt_of(const std::string& photograph, const calib::Calibration& found) {
    const std::string begin = photograph + ": ";
    for (const std::string& reason : found.reasons)
      if (reason.starts_with(begin)) return reason.substr(begin.size());
    return {};
  }
  /// Returns whether the photographs of a fit agree, so that its error says something.
  static bool agree(const calib::Calibration& found) {
    return !found.viewpoints.empty() &&
           std::ranges::all_of(found.viewpoints, [&found](const calib::Viewpoint& place) {
             return doubt_of(place.name, found).empty();
           });
  }
  /// Returns for each photograph whether it was used or the reason why not, whether it was set
  /// aside, in what it contradicts the others, the place of the camera and how it was held: the
  /// angle by which the rows of the picture are turned on the panel.
  [[nodiscard]] nlohmann::json to_json(const calib::Calibration& found) const {
    nlohmann::json out = nlohmann::json::array();
    for (const calib::PhonePhoto& photo : photos_) {
      const auto aside =
          std::ranges::find(found.set_aside, photo.name, &calib::SetAside::photograph);
      const bool is_aside = aside != found.set_aside.end();
      const std::string& reason = is_aside ? aside->reason : photo.findings.refusal;
      nlohmann::json entry = {{"name", escaped(photo.name)},
                              {"used", reason.empty()},
                              {"set_aside", is_aside},
                              {"reason", escaped(reason)},
                              {"doubt", escaped(doubt_of(photo.name, found))},
                              {"eye_mm", nullptr},
                              {"roll_degrees", nullptr}};
      if (const auto& pose = photo.findings.pose) {
        const auto& turn = pose->panel_from_camera;
        entry["roll_degrees"] = std::atan2(turn[3], turn[0]) * 180.0 / std::numbers::pi;
      }
      for (const calib::Viewpoint& place : found.viewpoints)
        if (place.name == photo.name)
          entry["eye_mm"] = {place.eye_mm.x, place.eye_mm.y, place.eye_mm.z};
      out.push_back(std::move(entry));
    }
    return out;
  }
  [[nodiscard]] calib::RecordDetails details() const {
    return {.method = is_film_ ? "film from the hand" : "photographs from the hand",
            .camera = camera_};
  }

 private:
  /// Returns the focal length in pixels: the given one, else the one that the file states, which is
  /// rounded to whole millimetres, else that of a usual phone.
  static calib::Estimate focal_of(std::optional<double> given_px, const std::filesystem::path& file,
                                  int longer_side) {
    if (given_px) return {*given_px, 0.02 * *given_px};
    if (const auto stated = calib::stated_focal_35mm(file))
      return calib::focal_of_film(*stated, longer_side);
    constexpr double kUsual = 0.75, kUsualSigma = 0.15;
    return {kUsual * longer_side, kUsualSigma * longer_side};
  }
  struct Measured {
    calib::PhonePhoto photo;
    calib::Estimate focal;
    int width, height;  ///< size of the picture, pixels
  };
  [[nodiscard]] Measured measure(const std::filesystem::path& file) const {
    return measure(calib::read_photograph(file), file, file.filename().string());
  }
  /// `only_tags` is as for calib::measure_hand_held().
  [[nodiscard]] Measured measure(const calib::CameraPicture& picture,
                                 const std::filesystem::path& file, std::string name,
                                 bool only_tags = false) const {
    const calib::Estimate focal =
        film_focal_px_ ? *film_focal_px_
                       : focal_of(given_focal_px_, file, std::max(picture.width, picture.height));
    return {.photo = {.name = std::move(name),
                      .findings = calib::measure_hand_held(picture, chart_, focal, only_tags)},
            .focal = focal,
            .width = picture.width,
            .height = picture.height};
  }
  std::string keep(Measured measured) {
    const std::string refusal = measured.photo.findings.refusal;
    if (refusal.empty()) {
      focal_px_.push_back(measured.focal);
      camera_.name = measured.photo.name;
      camera_.width = measured.width;
      camera_.height = measured.height;
    }
    photos_.push_back(std::move(measured.photo));
    return refusal;
  }

  calib::SinglePhotoChart chart_;
  std::optional<double> given_focal_px_;
  std::vector<calib::Estimate> focal_px_;  ///< one of each usable photograph
  std::vector<calib::PhonePhoto> photos_;
  std::vector<std::filesystem::path> files_;
  bool is_film_ = false;
  nlohmann::json film_;
  std::string film_refusal_;
  std::optional<calib::Estimate> film_focal_px_;  ///< as its tags show it
  calib::CameraFacts camera_{.channels = 3, .pixel_format = "photograph"};
};

// PhotoArrivals finds photographs that arrive in a folder.

/// PhotoArrivals reports each photograph and film once, after its file has stopped growing. Hidden
/// files, which transfers use as temporary names, do not count.
///
/// Thread safety: one thread.
class PhotoArrivals {
 public:
  /// With `existing`, photographs that are in the folder already count as arriving. Throws
  /// Error(Input) if the folder cannot be read.
  explicit PhotoArrivals(std::filesystem::path folder, bool existing = false)
      : folder_(std::move(folder)) {
    for (const auto& [file, size] : sizes())
      if (!existing) known_.insert(file);
  }

  /// Returns the photographs whose size has not changed since the previous call, in the order of
  /// their names. Throws Error(Input) if the folder cannot be read.
  [[nodiscard]] std::vector<std::filesystem::path> arrived() {
    std::vector<std::filesystem::path> out;
    std::map<std::filesystem::path, uintmax_t> now = sizes();
    for (const auto& [file, size] : now) {
      const auto before = growing_.find(file);
      if (known_.contains(file) || before == growing_.end() || before->second != size) continue;
      known_.insert(file);
      out.push_back(file);
    }
    growing_ = std::move(now);
    std::ranges::sort(
        out, NaturalOrder(),
        [](const std::filesystem::path& file) -> auto& { return file.native(); });
    return out;
  }

 private:
  [[nodiscard]] std::map<std::filesystem::path, uintmax_t> sizes() const {
    std::map<std::filesystem::path, uintmax_t> out;
    std::error_code error;
    for (const std::filesystem::path& file : entries_of(folder_, &error)) {
      std::error_code vanished;  // a file may be renamed between two calls
      if (!calib::is_photograph(file) && !is_film(file)) continue;
      const uintmax_t size = std::filesystem::file_size(file, vanished);
      if (!vanished && size > 0) out.emplace(file, size);
    }
    if (error)
      throw Error(ErrorKind::Input, folder_.string() + ": cannot be read: " + error.message(),
                  "name the folder in which the photographs of the phone arrive");
    return out;
  }

  std::filesystem::path folder_;
  std::set<std::filesystem::path> known_;
  std::map<std::filesystem::path, uintmax_t> growing_;
};

// write_photo_pack packs photographs of a calibration so that others can repeat it.

/// PhotoPack is what the archive holds. The report becomes report.json.
struct PhotoPack {
  std::vector<std::filesystem::path> sources;  ///< photographs, or folders of photographs
  optics::Rig start;                           ///< becomes start.toml
  std::optional<double> focal_px;
  std::vector<double> distances_mm;  ///< distances of the first sources from the panel
  nlohmann::json report;
};

inline void declare_pack_flag(CLI::App& app, std::string& archive) {
  cli::add_option(
      app, "--pack FILE", archive,
      "also write a tar archive of photographs, rig and result\n"
      "Others can repeat the calibration with it. JPEG files lose place, time and owner;\n"
      "films and other files are packed as they are.");
}

inline std::string command_of(const PhotoPack& pack, const std::vector<std::string>& names) {
  std::string command = "lenticule calibrate photos";
  for (const std::string& name : names) command += " '" + name + "'";
  command += " --rig start.toml -o again.toml";
  if (pack.focal_px) command += fmt::format(" --focal-px {}", *pack.focal_px);
  if (!pack.distances_mm.empty())
    command += fmt::format(" --distance {}", fmt::join(pack.distances_mm, ","));
  return command;
}

/// Copies photographs, JPEG files without what they say of place, time and owner.
inline void pack_source(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (std::filesystem::is_directory(from)) {
    std::filesystem::create_directory(to);
    for (const std::filesystem::path& entry : entries_of(from))
      pack_source(entry, to / entry.filename());
    return;
  }
  constexpr uint64_t kLargest = uint64_t{1} << 28;
  const std::string kind = lower_case(from.extension().string());
  if (kind == ".jpg" || kind == ".jpeg") {
    const std::vector<uint8_t> bytes = calib::anonymous_jpeg(read_whole_file(from, kLargest));
    write_text_file(to, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    return;
  }
  std::filesystem::copy_file(from, to);
  say("{}: packed as it is: look whether it states place, time or owner\n", from.string());
}

/// Returns "02.jpg" for the second source: names of phones have model and time.
inline std::string name_in_pack(size_t index, const std::filesystem::path& source) {
  return fmt::format("{:02}{}", index + 1, lower_case(source.extension().string()));
}

inline void run_tar(const std::filesystem::path& folder, const std::filesystem::path& archive) {
  constexpr std::chrono::minutes kLimit{10};
  const std::optional<std::string> tar = player::find_program("tar");
  if (!tar) throw Error(ErrorKind::Failed, "tar: no such program", "install the package tar");
  const ProgramRun run = player::run_child({*tar, "-cf", archive.string(), "-C", folder.string(),
                                            "--owner=0", "--group=0", "calibration"},
                                           kLimit);
  if (run.exit_code != 0)
    throw Error(ErrorKind::Failed, archive.string() + ": tar failed: " + run.output);
}

/// Writes a tar archive with one folder, `calibration`, whose README.txt has the command that
/// repeats the calibration. Sources keep their order by numbers before their names. The archive is
/// replaced when it is complete. Throws Error(Failed) if a file cannot be read or written, or if
/// the program tar is missing.
inline void write_photo_pack(const PhotoPack& pack, const std::filesystem::path& archive) {
  const std::filesystem::path parent =
      archive.has_parent_path() ? archive.parent_path() : std::filesystem::path(".");
  const TemporaryFolder work(parent);
  const std::filesystem::path folder = work.path() / "calibration";
  try {
    std::filesystem::create_directory(folder);
    std::vector<std::string> names;
    std::string report = pack.report.dump(2) + "\n";
    const auto rename = [&report](const std::string& from, const std::string& to) {
      for (size_t at = 0; !from.empty() && (at = report.find(from, at)) != std::string::npos;
           at += to.size())
        report.replace(at, from.size(), to);
    };
    for (size_t k = 0; k < pack.sources.size(); ++k) {
      names.push_back(name_in_pack(k, pack.sources[k]));
      pack_source(pack.sources[k], folder / names.back());
      rename(pack.sources[k].string(), names.back());
      rename(pack.sources[k].filename().string(), names.back());
    }
    optics::Rig start = pack.start;
    rename(start.identity.serial, "-");
    rename(start.identity.edid_sha256, "-");
    rename(start.name, "panel");
    start.identity = {};
    start.name = "panel";
    optics::save_rig(start, folder / "start.toml");
    write_text_file(folder / "report.json", report);
    write_text_file(folder / "README.txt",
                    fmt::format("Photographs of a lens sheet, for lenticule {}. To repeat the "
                                "calibration, run in this folder:\n\n    {}\n\n"
                                "report.json is the result of the original run.\n",
                                LENTICULE_VERSION, command_of(pack, names)));
    const std::filesystem::path made = work.path() / "pack.tar";
    run_tar(work.path(), made);
    std::filesystem::rename(made, archive);
    say("pack: {}\n", archive.string());
  } catch (const std::filesystem::filesystem_error& error) {
    throw failed_error("{}: cannot be packed: {}", error.path1().string(), error.code().message());
  }
}
}  // namespace lenticule::tools
