// SPDX-License-Identifier: Apache-2.0
// Tests the fit's model of fringes and wide patterns seen from the side against traced lenses. The
// observations have no noise, so that only the model's error remains.
#include <gtest/gtest.h>

#include <cmath>

#include "calib/fit/joint_fit.h"
#include "lab/panel/lens_sheet.h"
#include "lab/panel/simulated_sensor.h"
#include "lab/panel/trial.h"

namespace lenticule::test {
namespace {

using namespace calib;

constexpr double kPhaseSigma = 0.002;
constexpr double kPointSigmaPx = 0.1;

class TracedViews {
 public:
  explicit TracedViews(const lab::Trial& trial)
      : trial_(trial), shape_(trial.panel, trial.sheet, 0.0) {
    for (const lab::TrialViewpoint& place : trial.viewpoints) views_.push_back(view_from(place));
  }

  [[nodiscard]] std::optional<JointFit> fit() const {
    SheetStart start = sheet_start(trial_.start);
    const double lenses = 1.5 / trial_.sheet.pitch_subpx;
    start.values[kAcross] = lenses * trial_.panel.width_px;
    start.values[kDown] = lenses * trial_.sheet.slant * trial_.panel.height_px;
    const std::optional<PoseFit> poses = fit_poses(views_, start.values, trial_.panel);
    if (!poses) return std::nullopt;
    const std::vector<GapCandidate> gaps = search_gaps(views_, *poses, start, trial_.panel);
    if (gaps.empty()) return std::nullopt;
    return fit_jointly(views_, *poses, start, gaps.front(), trial_.panel,
                       {.grid = {.columns = 0, .rows = 0}});
  }

 private:
  [[nodiscard]] View view_from(const lab::TrialViewpoint& place) const {
    lab::SimulatedCamera camera = trial_.camera;
    camera.position_mm = place.position_mm;
    camera.look_at_mm = place.look_at_mm;
    camera.roll_degrees = place.roll_degrees;
    View view{.name = place.name,
              .fringe = {.pitch_subpx = 1.003 * trial_.sheet.pitch_subpx,
                         .slant = trial_.sheet.slant,
                         .phase = 0.0},
              .picture_width = camera.width,
              .picture_height = camera.height,
              .geometry = {},
              .phases = {}};
    constexpr int kColumns = 32, kRows = 18;
    for (int n = 0; n < kColumns * kRows; ++n) {
      const double x = (n % kColumns + 0.5) / kColumns, y = (n / kColumns + 0.5) / kRows;
      add_point({x * trial_.panel.width_px, y * trial_.panel.height_px}, camera, view);
    }
    return view;
  }

  void add_point(Vec2 panel_px, const lab::SimulatedCamera& camera, View& view) const {
    const lab::CameraRays rays(camera);
    const Vec2 point{trial_.panel.x_mm(panel_px.x), trial_.panel.y_mm(panel_px.y)};
    const Vec3& eye = camera.position_mm;
    const auto middle = true_view(shape_, point, 1, eye, lab::LightMiddle::Centroid);
    const auto fringe = true_view(shape_, point, 1, eye, lab::LightMiddle::FringePhase);
    if (!middle || !fringe) return;
    const std::optional<Vec2> at_middle = rays.project(middle->aim);
    const std::optional<Vec2> at_fringe = rays.project(fringe->aim);
    if (!at_middle || !at_fringe) return;
    view.geometry.push_back(
        {.camera_px = *at_middle, .panel_px = panel_px, .sigma_px = kPointSigmaPx});
    const PlanePoint<double> shown{point.x, point.y};
    view.phases.push_back({.camera_px = *at_fringe,
                           .turns = fringe_turns(view.fringe, trial_.panel, shown) - fringe->phase,
                           .sigma = kPhaseSigma});
  }

  const lab::Trial& trial_;
  lab::SheetShape shape_;
  std::vector<View> views_;
};

/// Tests sheets of wide and narrow viewing cones, fine and coarse.
class TracedLaw : public testing::TestWithParam<uint64_t> {};

TEST_P(TracedLaw, HoldsForEveryEyeInTheZone) {
  lab::Trial trial = lab::random_trial(GetParam(), 3840, 2160, 1920, 1080);
  trial.sheet.deformation_lenses = 0.0;
  const std::optional<JointFit> fit = TracedViews(trial).fit();
  ASSERT_TRUE(fit);
  optics::Rig rig = trial.start;
  set_sheet(fit->values.sheet, {.columns = 0, .rows = 0}, {}, trial.panel, rig.sheet);
  const lab::SimulatedBench bench(trial.panel, trial.sheet, trial.link, trial.camera, trial.seed);
  const lab::TrialErrors errors = errors_of(rig, bench, trial);
  EXPECT_LT(errors.worst_lenses, 0.012);
  EXPECT_LT(std::abs(errors.pitch), 2e-6);
  EXPECT_LT(std::abs(errors.slant), 3e-6);
  EXPECT_LT(std::abs(errors.gap), 2e-3);
  EXPECT_GT(fit->values.sheet[kAberration], 0.0);
}

INSTANTIATE_TEST_SUITE_P(RandomSheets, TracedLaw, testing::Values(1, 2, 8, 17, 24));

}  // namespace
}  // namespace lenticule::test
