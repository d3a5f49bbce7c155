// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/phone_start.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "calib/fit/observations.h"

namespace lenticule::calib {
namespace {

using Eigen::VectorXd;

/// Returns the pose block of a pose whose camera looks along -z with y up.
PoseValues pose_values(const PhotoPose& pose) {
  PoseValues out{};
  const auto& m = pose.panel_from_camera;
  // Row-major camera_from_panel: transposed, with y and z turned round.
  const std::array<double, 9> turned = {m[0], m[3], m[6], -m[1], -m[4], -m[7], -m[2], -m[5], -m[8]};
  ceres::RotationMatrixToAngleAxis(ceres::RowMajorAdapter3x3(turned.data()), out.data());
  out[kPupil] = pose.eye_mm.x;
  out[kPupil + 1] = pose.eye_mm.y;
  out[kPupil + 2] = pose.eye_mm.z;
  return out;
}

/// Writes the gap and the offset that fit best into the values.
void search_gap(const PhoneModel& model, VectorXd& values) {
  constexpr int kSteps = 60;
  const std::vector<PhoneObservations>& photos = model.seen();
  double* sheet = values.data() + kCameraCount;
  const double start = sheet[kGap];
  double best = -1.0, best_gap = start, best_offset = 0.0;
  sheet[kOffset] = 0.0;
  for (int k = -kSteps; k <= kSteps; ++k) {
    sheet[kGap] = start * (1.0 + 0.3 * k / kSteps);
    std::complex<double> sum;
    for (size_t n = 0; n < photos.size(); ++n) {
      std::complex<double> own;
      for (const FringeSeen& seen : photos[n].phases)
        own += std::polar(1.0, 2.0 * std::numbers::pi * model.phase_rest(values, n, seen));
      sum += own / static_cast<double>(std::max<size_t>(photos[n].phases.size(), 1));
    }
    const double off = 0.3 * k / kSteps / kGapSigma;
    const double score = std::abs(sum) / static_cast<double>(photos.size()) - 0.02 * off * off;
    if (score <= best) continue;
    best = score;
    best_gap = sheet[kGap];
    // rest = turns - (comb - lens) with offset 0: the offset is minus its mean.
    best_offset = -std::arg(sum) / (2.0 * std::numbers::pi);
  }
  sheet[kGap] = best_gap;
  sheet[kOffset] = best_offset;
}

}  // namespace

PhoneStart phone_start(const PhoneModel& model, const std::vector<PhotoFindings>& photos,
                       const optics::Rig& rig, const Estimate& focal_px) {
  PhoneStart start;
  VectorXd& values = start.values;
  values = VectorXd::Zero(model.size());
  double focal = 0.0, radial = 0.0, across = 0.0, down = 0.0;
  const double share = 1.0 / static_cast<double>(photos.size());
  const auto photo = [&](size_t n) { return values.data() + model.photo_at(n); };
  for (size_t n = 0; n < photos.size(); ++n) {
    const PhotoPose& pose = *photos[n].pose;
    focal += share * pose.focal_px;
    radial -= share * pose.distortion;
    const PoseValues block = pose_values(pose);
    std::copy(block.begin(), block.end(), photo(n));
    photo(n)[PhoneModel::kLarger] = pose.tags_larger;
    const LensPlane plane = plane_of(photos[n].rig);
    across += 0.5 * share * plane.across;
    down += 0.5 * share * plane.down;
  }
  values[kFocal] = focal;
  values[kCentreX] = 0.5 * photos[0].width;
  values[kCentreY] = 0.5 * photos[0].height;
  values[kRadial1] = radial;
  const SheetParameters sheet = sheet_start(rig).values;
  std::copy(sheet.begin(), sheet.end(), values.data() + kCameraCount);
  // The photographs' own poses have one focal length and principal point each.
  for (size_t n = 0; n < photos.size(); ++n) {
    const PhotoPose& pose = *photos[n].pose;
    photo(n)[PhoneModel::kBreathing] = pose.focal_px / focal - 1.0;
    photo(n)[PhoneModel::kShiftX] = (pose.middle_px.x - values[kCentreX]) / model.longer_px();
    photo(n)[PhoneModel::kShiftY] = (pose.middle_px.y - values[kCentreY]) / model.longer_px();
  }
  values[kCameraCount + kAcross] = across;
  values[kCameraCount + kDown] = down;
  start.prior = values;
  start.prior[kFocal] = focal_px.value;
  start.prior[kRadial1] = 0.0;
  search_gap(model, values);
  return start;
}

}  // namespace lenticule::calib
