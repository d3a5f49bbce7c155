// SPDX-License-Identifier: Apache-2.0
// Provides observations made by formula, with noise of known size.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "calib/fit/observations.h"

namespace lenticule::calib::test {

/// FitStage has three cameras in front of a known sheet.
class FitStage {
 public:
  /// `own` are the deviations of the three views' cameras from the common one. Points are observed
  /// every `spacing_px` camera pixels.
  explicit FitStage(unsigned seed, double phase_noise = 0.004,
                    const std::array<OwnCameraValues, 3>& own = {}, double spacing_px = 40.0)
      : random_(seed), spacing_px_(spacing_px) {
    panel_.width_px = 3840;
    panel_.height_px = 2160;
    panel_.pixel_width = panel_.pixel_height = Millimetres(0.1557);
    ground_truth_ = {
        1.5 * 3840 / 7.70123, 1.5 * 0.2521 * 2160 / 7.70123, 0.31, 2.19, 0.46, 0.02, 0.03};
    constexpr std::array<Vec3, 3> kEyes = {Vec3{10, 20, 700}, Vec3{-240, 0, 690},
                                           Vec3{265, 30, 720}};
    constexpr std::array<const char*, 3> kNames = {"centre", "left", "right"};
    for (size_t v = 0; v < kEyes.size(); ++v) add_view(kNames[v], kEyes[v], own[v], phase_noise);
  }

  [[nodiscard]] const std::vector<View>& views() const { return views_; }
  [[nodiscard]] const optics::Panel& panel() const { return panel_; }
  [[nodiscard]] const SheetParameters& ground_truth() const { return ground_truth_; }
  [[nodiscard]] SheetStart start(double gap_factor) const {
    SheetStart start{.values = ground_truth_};
    start.values[kGap] *= gap_factor;
    start.values[kShape] = 0.5;
    start.values[kAberration] = start.values[kSag] = 0.0;
    return start;
  }

  /// Returns a rig that starts with a gap 10 % too small.
  [[nodiscard]] optics::Rig start_rig() const {
    optics::Rig rig;
    rig.panel = panel_;
    set_sheet(start(0.9).values, {}, {}, panel_, rig.sheet);
    return rig;
  }
  /// Returns the views as measurements of green; red and blue are not measured.
  [[nodiscard]] std::vector<ViewpointMeasurement> measurements() const {
    std::vector<ViewpointMeasurement> all;
    for (const View& view : views_) all.push_back(measurement_of(view));
    return all;
  }

 private:
  /// Returns the pose of a camera at `eye` that looks at the panel's centre.
  static PoseValues looking_at_centre(const Vec3& eye) {
    const Vec3 forward = normalized(-eye);
    const Vec3 right = normalized(cross(forward, Vec3{0, 1, 0}));
    const Vec3 down = cross(forward, right);
    Eigen::Matrix3d m;
    m << right.x, right.y, right.z, down.x, down.y, down.z, forward.x, forward.y, forward.z;
    const Eigen::AngleAxisd turn(m);
    const Eigen::Vector3d axis = turn.angle() * turn.axis();
    return {axis[0], axis[1], axis[2], eye.x, eye.y, eye.z};
  }

  void add_view(const std::string& name, const Vec3& eye, const OwnCameraValues& own,
                double phase_noise) {
    std::normal_distribution<double> normal;
    const PoseValues pose = looking_at_centre(eye);
    View view{.name = name,
              .fringe = {.pitch_subpx = 7.75, .slant = 0.2521, .phase = 0.0},
              .picture_width = 1920,
              .picture_height = 1080,
              .geometry = {},
              .phases = {}};
    const CameraValues camera = camera_of({1400.0, 965.0, 536.0, -0.03, 0.0}, own, view);
    for (double v = 0.5 * spacing_px_; v < 1080.0; v += spacing_px_)
      for (double u = 0.5 * spacing_px_; u < 1920.0; u += spacing_px_) {
        const auto lens = lens_plane_point(camera.data(), pose.data(), u, v);
        const auto wide = wide_pattern_point(pose.data(), ground_truth_.data(), panel_, lens);
        const auto q = fringe_point(pose.data(), ground_truth_.data(), panel_, lens);
        const Vec2 at{panel_.x_px(wide.x), panel_.y_px(wide.y)};
        if (at.x < 0 || at.y < 0 || at.x > 3840 || at.y > 2160) continue;
        view.geometry.push_back(
            {.camera_px = {u, v},
             .panel_px = {at.x + 0.1 * normal(random_), at.y + 0.1 * normal(random_)},
             .sigma_px = 0.1});
        const double turns = fringe_turns(view.fringe, panel_, q) -
                             lens_coordinate(ground_truth_.data(), panel_, lens);
        view.phases.push_back(
            {.camera_px = {u, v}, .turns = turns + phase_noise * normal(random_), .sigma = 0.004});
      }
    views_.push_back(view);
  }

  [[nodiscard]] ViewpointMeasurement measurement_of(const View& view) const {
    ViewpointMeasurement m;
    m.name = view.name;
    m.width = view.picture_width;
    m.height = view.picture_height;
    m.fringe = view.fringe;
    const double per_px = 2.0 * ground_truth_[kAcross] / panel_.width_px;
    m.line = {.constant = 0.0,
              .per_px_x = per_px,
              .per_px_y = 2.0 * ground_truth_[kDown] / panel_.height_px};
    m.geometry = view.geometry;
    m.contrast = 0.8;
    m.covered = 1.0;
    for (size_t n = 0; n < view.phases.size(); ++n) {
      const PhaseObservation& seen = view.phases[n];
      const Vec2 at = view.geometry[n].panel_px;
      const double s = 3.0 * ((at.x - panel_.width_px / 2.0) +
                              view.fringe.slant * (at.y - panel_.height_px / 2.0));
      m.blocks[1].blocks.push_back({.camera_px = seen.camera_px,
                                    .panel_px = at,
                                    .pixels = 100,
                                    .phase = s / view.fringe.pitch_subpx - seen.turns,
                                    .sigma = seen.sigma});
    }
    m.blocks[0].blocks.resize(view.phases.size());
    m.blocks[2].blocks.resize(view.phases.size());
    return m;
  }

  std::mt19937 random_;
  double spacing_px_;
  optics::Panel panel_;
  SheetParameters ground_truth_{};
  std::vector<View> views_;
};

}  // namespace lenticule::calib::test
