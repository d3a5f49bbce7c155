// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/hand_held_photos.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <future>
#include <numbers>
#include <utility>

#include "base/text.h"
#include "calib/phone/exif.h"

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

HandHeldPhotos::HandHeldPhotos(const optics::Rig& rig, std::optional<double> focal_px,
                               PhotoReader read)
    : chart_(calib::plan_single_photo_chart(rig)),
      given_focal_px_(focal_px),
      read_(std::move(read)) {
  camera_.channels = 3;
  camera_.pixel_format = "photograph";
}

HandHeldPhotos::Measured HandHeldPhotos::measure(const std::filesystem::path& file) const {
  const calib::CameraPicture photograph = read_(file);
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
  return {.when = std::chrono::system_clock::now(),
          .method = "photographs from the hand",
          .camera = camera_,
          .temperature_celsius = {}};
}

}  // namespace lenticule::tools
