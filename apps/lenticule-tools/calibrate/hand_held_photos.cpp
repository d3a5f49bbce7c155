// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/hand_held_photos.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <deque>
#include <future>
#include <numbers>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/temporary.h"
#include "base/text.h"
#include "calib/phone/exif.h"
#include "optics/rig_file.h"
#include "player/process/child_process.h"

namespace lenticule::tools {

namespace {

/// Returns the focal length in pixels: the given one, else the one that the file states, which is
/// rounded to whole millimetres, else that of a usual phone.
calib::Estimate focal_of(std::optional<double> given_px, const std::filesystem::path& file,
                         int longer_side) {
  if (given_px) return {*given_px, 0.02 * *given_px};
  if (const auto stated = calib::stated_focal_35mm(file))
    return calib::focal_of_film(*stated, longer_side);
  constexpr double kUsual = 0.75, kUsualSigma = 0.15;
  return {kUsual * longer_side, kUsualSigma * longer_side};
}

}  // namespace

HandHeldPhotos::HandHeldPhotos(const optics::Rig& rig, std::optional<double> focal_px)
    : chart_(calib::plan_single_photo_chart(rig)), given_focal_px_(focal_px) {
  camera_.channels = 3;
  camera_.pixel_format = "photograph";
}

HandHeldPhotos::Measured HandHeldPhotos::measure(const std::filesystem::path& file) const {
  const calib::CameraPicture photograph = calib::read_photograph(file);
  const calib::Estimate focal =
      focal_of(given_focal_px_, file, std::max(photograph.width, photograph.height));
  return {.photo = {.name = file.filename().string(),
                    .findings = calib::measure_hand_held(photograph, chart_, focal)},
          .focal = focal,
          .width = photograph.width,
          .height = photograph.height};
}

std::string HandHeldPhotos::keep(const std::filesystem::path& file, Measured measured) {
  const std::string refusal = measured.photo.findings.refusal;
  if (refusal.empty()) {
    focal_px_ = measured.focal;
    camera_.name = measured.photo.name;
    camera_.width = measured.width;
    camera_.height = measured.height;
  }
  photos_.push_back(std::move(measured.photo));
  files_.push_back(file);
  return refusal;
}

std::string HandHeldPhotos::add(const std::filesystem::path& file) {
  return keep(file, measure(file));
}

void HandHeldPhotos::add_all(const std::vector<std::filesystem::path>& files,
                             const std::function<bool(size_t)>& goes_on) {
  constexpr size_t kAtOnce = 2;  // 12 megapixels take a quarter of a gigabyte each
  std::deque<std::future<Measured>> waiting;
  size_t begun = 0;
  for (size_t n = 0; n < files.size(); ++n) {
    for (; begun < std::min(files.size(), n + kAtOnce); ++begun)
      waiting.push_back(
          std::async(std::launch::async, [this, &file = files[begun]] { return measure(file); }));
    keep(files[n], waiting.front().get());
    waiting.pop_front();
    if (!goes_on(n + 1)) return;
  }
}

size_t HandHeldPhotos::usable() const {
  return static_cast<size_t>(std::ranges::count_if(
      photos_, [](const calib::PhonePhoto& photo) { return photo.findings.refusal.empty(); }));
}

std::optional<optics::Rig> HandHeldPhotos::better_start() const {
  if (photos_.empty()) return std::nullopt;
  return calib::better_start(photos_.back().findings, chart_);
}

calib::Calibration HandHeldPhotos::calibrate(double most_lenses) const {
  return calib::calibrate_phone(photos_, chart_, focal_px_, most_lenses);
}

nlohmann::json HandHeldPhotos::to_json(const calib::Calibration& found) const {
  nlohmann::json out = nlohmann::json::array();
  for (const calib::PhonePhoto& photo : photos_) {
    std::string reason = photo.findings.refusal;
    const std::string begin = photo.name + ": ";
    for (const std::string& one : found.reasons)
      if (reason.empty() && one.starts_with(begin)) reason = one.substr(begin.size());
    nlohmann::json entry = {{"name", escaped(photo.name)},
                            {"used", reason.empty()},
                            {"reason", escaped(reason)},
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

calib::RecordDetails HandHeldPhotos::details() const {
  return {.method = "photographs from the hand", .camera = camera_};
}

namespace {

namespace fs = std::filesystem;

/// Returns true also for HEIC, which phones store by default and which reading refuses by name.
bool is_picture(const fs::path& file) {
  constexpr std::array<std::string_view, 8> kExtensions = {".jpg", ".jpeg", ".png",  ".tif",
                                                           ".exr", ".tiff", ".heic", ".heif"};
  const std::string extension = lower_case(file.extension().string());
  return file.filename().string().front() != '.' &&
         std::ranges::find(kExtensions, extension) != kExtensions.end();
}

}  // namespace

PhotoArrivals::PhotoArrivals(fs::path folder, bool existing) : folder_(std::move(folder)) {
  for (const auto& [file, size] : sizes())
    if (!existing) known_.insert(file);
}

std::map<fs::path, uintmax_t> PhotoArrivals::sizes() const {
  std::map<fs::path, uintmax_t> out;
  std::error_code error;
  for (const fs::path& file : entries_of(folder_, &error)) {
    std::error_code vanished;  // a file may be renamed between two calls
    if (!is_picture(file) || !fs::is_regular_file(file, vanished)) continue;
    const uintmax_t size = fs::file_size(file, vanished);
    if (!vanished && size > 0) out.emplace(file, size);
  }
  if (error)
    throw Error(ErrorKind::Input, folder_.string() + ": cannot be read: " + error.message(),
                "name the folder in which the photographs of the phone arrive");
  return out;
}

std::vector<fs::path> PhotoArrivals::arrived() {
  std::vector<fs::path> out;
  std::map<fs::path, uintmax_t> now = sizes();
  for (const auto& [file, size] : now) {
    const auto before = growing_.find(file);
    if (known_.contains(file) || before == growing_.end() || before->second != size) continue;
    known_.insert(file);
    out.push_back(file);
  }
  growing_ = std::move(now);
  std::ranges::sort(out, [](const fs::path& a, const fs::path& b) {
    return calib::stands_before(a.filename().string(), b.filename().string());
  });
  return out;
}

namespace {

std::string command_of(const PhotoPack& pack, const std::vector<std::string>& names) {
  std::string command = "lenticule calibrate photos";
  for (const std::string& name : names) command += " '" + name + "'";
  command += " --rig start.toml -o again.toml";
  if (pack.focal_px) command += fmt::format(" --focal-px {}", *pack.focal_px);
  if (!pack.distances_mm.empty())
    command += fmt::format(" --distance {}", fmt::join(pack.distances_mm, ","));
  return command;
}

/// Returns "02-IMG_7.jpg" for the second source.
std::string name_in_pack(size_t index, const fs::path& source) {
  std::string name = source.filename().string();
  if (name.empty()) name = source.parent_path().filename().string();  // "folder/"
  std::erase(name, '\'');
  return fmt::format("{:02}-{}", index + 1, name);
}

void run_tar(const fs::path& folder, const fs::path& archive) {
  constexpr std::chrono::minutes kLimit{10};
  const std::optional<std::string> tar = player::find_program("tar");
  if (!tar) throw Error(ErrorKind::Failed, "tar: no such program", "install the package tar");
  const ProgramRun run = player::run_child({*tar, "-cf", archive.string(), "-C", folder.string(),
                                            "--owner=0", "--group=0", "calibration"},
                                           kLimit);
  if (run.exit_code != 0)
    throw Error(ErrorKind::Failed, archive.string() + ": tar failed: " + run.output);
}

}  // namespace

void declare_pack_flag(CLI::App& app, std::string& archive) {
  app.add_option("--pack", archive,
                 "also write a tar archive of photographs, rig and result\n"
                 "Others can repeat the calibration with it.")
      ->type_name("FILE");
}

void write_photo_pack(const PhotoPack& pack, const fs::path& archive) {
  const fs::path parent = archive.has_parent_path() ? archive.parent_path() : fs::path(".");
  const TemporaryFolder work(parent);
  const fs::path folder = work.path() / "calibration";
  try {
    fs::create_directory(folder);
    std::vector<std::string> names;
    for (size_t k = 0; k < pack.sources.size(); ++k) {
      names.push_back(name_in_pack(k, pack.sources[k]));
      fs::copy(pack.sources[k], folder / names.back(), fs::copy_options::recursive);
    }
    optics::save_rig(pack.start, folder / "start.toml");
    write_text_file(folder / "report.json", pack.report.dump(2) + "\n");
    write_text_file(folder / "README.txt",
                    fmt::format("Photographs of a lens sheet, for lenticule {}. To repeat the "
                                "calibration, run in this folder:\n\n    {}\n\n"
                                "report.json is the result of the original run.\n",
                                LENTICULE_VERSION, command_of(pack, names)));
    const fs::path made = work.path() / "pack.tar";
    run_tar(work.path(), made);
    fs::rename(made, archive);
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot be packed: {}", error.path1().string(),
                                               error.code().message()));
  }
}
}  // namespace lenticule::tools
