// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/calibrate/hand_trial.h"

#include "calib/phone/exif.h"
#include "frames/srgb.h"

namespace lenticule::bench {
namespace {

/// Returns a photograph in linear light, as a reader decodes its codes.
calib::CameraPicture picture_of(const Photo& photo) {
  calib::CameraPicture picture;
  picture.width = photo.width;
  picture.height = photo.height;
  picture.channels = 3;
  picture.light.reserve(photo.codes.size());
  for (const uint8_t code : photo.codes)
    picture.light.push_back(static_cast<float>(frames::linear_of_codes()[code]));
  return picture;
}

}  // namespace

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

HandTrial::HandTrial(uint64_t seed, const WorkshopLimits& limits)
    : workshop_(draw_workshop(seed, limits)),
      sheet_(workshop_.build, workshop_.start.panel),
      chart_(calib::plan_single_photo_chart(workshop_.start)) {
  take(workshop_.shots.front());
  // The owner obeys the program, which asks for a new start if the pitch is far off.
  if (const auto better = calib::better_start(photos_.front().findings, chart_)) {
    chart_ = calib::plan_single_photo_chart(*better);
    photos_.clear();
    take(workshop_.shots.front());
  }
  for (size_t n = 1; n < workshop_.shots.size(); ++n) take(workshop_.shots[n]);
}

void HandTrial::take(const Shot& shot) {
  const frames::WovenFrame shown = draw_single_photo_chart(chart_);
  Photo photo = photograph(sheet_, shown.view(), workshop_.phone, shot);
  round_trip(photo, workshop_.phone.jpeg_quality);
  focal_px_ = calib::focal_of_film(photo.stated_focal_35mm, photo.width);
  calib::CameraPicture picture = picture_of(photo);
  photos_.push_back({.name = "photograph " + std::to_string(photos_.size() + 1),
                     .findings = calib::measure_hand_held(picture, chart_, focal_px_)});
  if (photos_.size() == 1) first_picture_ = std::move(picture);
}

double HandTrial::error_of(const optics::Rig& rig) const {
  return worst_error(rig, sheet_, judged_eyes(workshop_.start));
}

HandResult HandTrial::calibrate_single() const {
  const calib::Calibration found = calib::fit_single_photo(
      first_picture_, chart_, {.focal_px = focal_px_, .distance_mm = std::nullopt});
  HandResult out;
  out.photographs = 1;
  out.reasons = found.reasons;
  out.fit_seconds = found.seconds_computing;
  out.fitted = found.verdict != calib::Verdict::Refused;
  if (!out.fitted) return out;
  out.error_lenses = worst_error(found.rig, sheet_, {workshop_.shots.front().eye_mm});
  out.stated_lenses = found.drift.worst_lenses;
  if (out.stated_lenses <= kMostLenses)
    out.outcome = out.error_lenses <= kMostLenses ? HandOutcome::Right : HandOutcome::Wrong;
  return out;
}

HandResult HandTrial::calibrate(int photographs) const {
  if (photographs == 1) return calibrate_single();
  const calib::Calibration found =
      calib::calibrate_phone({photos_.begin(), photos_.begin() + photographs}, chart_, focal_px_);
  HandResult out;
  out.photographs = photographs;
  out.reasons = found.reasons;
  out.fit_seconds = found.seconds_computing;
  out.fitted = !found.viewpoints.empty() && !optics::find_problem(found.rig);
  if (!out.fitted) return out;
  out.error_lenses = error_of(found.rig);
  out.stated_lenses = found.drift.worst_lenses;
  if (found.verdict != calib::Verdict::Refused)
    out.outcome = out.error_lenses <= kMostLenses ? HandOutcome::Right : HandOutcome::Wrong;
  return out;
}

}  // namespace lenticule::bench
