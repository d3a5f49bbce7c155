// SPDX-License-Identifier: Apache-2.0
#include "lab/phone/sweep_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "frames/srgb.h"
#include "optics/rig_file.h"

namespace lenticule::lab {

calib::CameraPicture picture_of(const Photo& photo) {
  calib::CameraPicture picture;
  picture.width = photo.width;
  picture.height = photo.height;
  picture.channels = 3;
  picture.light.resize(photo.codes.size());
  const auto& light = frames::linear_of_codes();
  std::ranges::transform(photo.codes, picture.light.begin(),
                         [&light](uint8_t code) { return static_cast<float>(light[code]); });
  return picture;
}

const char* to_string(HandOutcome outcome) {
  switch (outcome) {
    case HandOutcome::Right:
      return "right";
    case HandOutcome::Refused:
      return "refused";
    case HandOutcome::Wrong:
      return "WRONG";
  }
  return "";
}

SweepTrial::SweepTrial(uint64_t seed, const WorkshopLimits& limits,
                       const std::filesystem::path& pictures)
    : workshop_(draw_workshop(seed, limits)),
      sheet_(workshop_.start.panel, workshop_.build),
      focal_px_{0.75 * limits.phone_width, 0.15 * limits.phone_width} {
  make_film_camera(seed, limits.phone_width, workshop_.phone);
  // The chart was planned again if the pitch was far off.
  const double pitch = workshop_.build.pitch_subpx;
  double& start = workshop_.start.sheet.pitch.value;
  start = std::clamp(start, 0.995 * pitch, 1.005 * pitch);
  chart_ = calib::plan_single_photo_chart(workshop_.start);
  const frames::WovenFrame shown = draw_single_photo_chart(chart_);
  const Sweep sweep(seed, workshop_);
  constexpr double kStep = 0.1;
  int stored = 0;
  const auto store = [&](const Photo& photo) {
    if (!pictures.empty()) write_photo(photo, 95, pictures / fmt::format("{:03}.jpg", stored++));
  };
  if (!pictures.empty()) {
    std::filesystem::create_directories(pictures);
    optics::save_rig(chart_.start, pictures / "start.toml");
  }
  const auto take = [&](double seconds, bool neighbour) {
    Shot shot = sweep.at(seconds);
    if (neighbour) shot.exposure_s = 0.0;  // only its tags are needed
    Photo photo = photograph(sheet_, shown.view(), workshop_.phone, shot);
    store(photo);
    round_trip(photo, workshop_.phone.jpeg_quality);
    return picture_of(photo);
  };
  std::vector<calib::CameraPicture> centres;
  for (int place = 0; place < limits.shots; ++place) {
    for (const double neighbour : {-kStep, 0.0, kStep}) {
      const double seconds = sweep.seconds() * (place + 0.5) / limits.shots + neighbour;
      calib::CameraPicture picture = take(seconds, neighbour != 0.0);
      frames_.push_back({.number = frames_.size(),
                         .seconds = seconds,
                         .found = calib::measure_hand_held(picture, chart_, focal_px_, true)});
      if (neighbour != 0.0) frames_.back().found.refusal = "only a neighbour";
      centres.push_back(neighbour == 0.0 ? std::move(picture) : calib::CameraPicture());
    }
    const int width = workshop_.phone.width, height = workshop_.phone.height;
    store({width, height, std::vector<uint8_t>(size_t{3} * width * height, 40)});
  }
  const calib::FilmChoice choice = calib::choose_frames(frames_, chart_);
  refusal_ = choice.refusal;
  focal_px_ = choice.focal_px.value_or(focal_px_);
  for (const auto& [index, motion] : choice.frames) {
    chosen_.push_back({.name = "frame " + std::to_string(index),
                       .findings = calib::measure_hand_held(centres[index], chart_, focal_px_)});
    chosen_.back().findings.motion = motion;
  }
}

HandResult SweepTrial::calibrate(const std::vector<calib::PhonePhoto>& frames) const {
  HandResult out;
  out.photographs = static_cast<int>(frames.size());
  out.reasons = {refusal_};
  if (!refusal_.empty()) return out;
  const calib::Calibration found = calib::calibrate_phone(frames, chart_, focal_px_);
  out.reasons = found.reasons;
  out.reasons.insert(out.reasons.end(), found.warnings.begin(), found.warnings.end());
  out.fit_seconds = found.seconds_computing;
  out.fitted = !found.viewpoints.empty() && !optics::find_problem(found.rig);
  if (!out.fitted) return out;
  out.error_lenses = worst_error(found.rig, sheet_, judged_eyes(workshop_.start));
  out.stated_lenses = found.drift.worst_lenses;
  if (found.verdict != calib::Verdict::Refused)
    out.outcome = out.error_lenses <= kMostHandLenses ? HandOutcome::Right : HandOutcome::Wrong;
  return out;
}

}  // namespace lenticule::lab
