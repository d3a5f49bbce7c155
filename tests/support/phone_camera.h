// SPDX-License-Identifier: Apache-2.0
// PhoneCamera is a simulated panel under a real lens sheet, and a phone that photographs it from
// the middle viewpoint.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "frames/frame.h"
#include "frames/srgb.h"
#include "lab/panel/trial.h"
#include "optics/model.h"

namespace lenticule::test {

class PhoneCamera {
 public:
  static constexpr int kPanelWidth = 3840, kPanelHeight = 2160;

  PhoneCamera() {
    const lab::TrialViewpoint& place = trial_.viewpoints.front();
    bench_.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
  }

  /// Returns the rig that its owner assumes before the calibration.
  [[nodiscard]] const optics::Rig& start() const { return trial_.start; }
  [[nodiscard]] double distance_mm() const { return trial_.viewpoints.front().position_mm.z; }

  /// Returns the photograph of the panel that shows the frame, as a picture file stores it.
  [[nodiscard]] frames::WovenFrame photograph(const frames::WovenFrame& shown) {
    constexpr int kPicturesUntilSettled = 4;
    constexpr auto kLong = std::chrono::seconds(10);
    bool taken = bench_.sink().show(shown.view(), kLong) == frames::ShowResult::Shown;
    calib::CameraPicture picture;
    for (int n = 0; n < kPicturesUntilSettled; ++n)
      taken = taken && bench_.camera().grab(picture, kLong) == calib::GrabStatus::Ready;
    if (!taken) throw std::runtime_error("the simulated camera took no picture");
    frames::WovenFrame photo({.width = picture.width, .height = picture.height});
    const auto channels = static_cast<size_t>(picture.channels);
    for (size_t k = 0; k < photo.bytes().size(); ++k) {
      const size_t channel = channels == 3 ? k % 3 : 0;
      photo.bytes()[k] =
          frames::code_from_linear(double{picture.light[k / 3 * channels + channel]});
    }
    return photo;
  }

  /// Returns the largest phase error of the rig over the panel, for an eye at the place of the
  /// camera.
  [[nodiscard]] double worst_phase(const optics::Rig& rig) const {
    const optics::OpticalModel model(rig);
    const Vec3 eye = bench_.ground_truth_camera().position_mm;
    double worst = 0.0;
    for (double y = 216.0; y < kPanelHeight; y += 216.0)
      for (double x = 240.0; x < kPanelWidth; x += 240.0) {
        const double off =
            model.phase(x, y, 1, {eye.x, eye.y, eye.z}) - bench_.ground_truth_phase(x, y, 1, eye);
        worst = std::max(worst, std::abs(off - std::round(off)));
      }
    return worst;
  }

 private:
  static lab::Trial phone_trial() {
    lab::Trial trial = lab::plain_trial(kPanelWidth, kPanelHeight, 1280, 720);
    trial.link.response_ms = 1.0;
    return trial;
  }

  lab::Trial trial_ = phone_trial();
  lab::SimulatedBench bench_{trial_.panel, trial_.sheet, trial_.link, trial_.camera, trial_.seed};
};

}  // namespace lenticule::test
