// SPDX-License-Identifier: Apache-2.0
// Tests that the picture of a scene does not depend on its origin or its unit.
#include <gtest/gtest.h>

#include <cstdlib>

#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

frames::WovenFrame picture(const render::SceneDescription& description, const render::Stage& stage,
                           const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  const render::Scene scene(description, stage, {}, 1);
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
  const auto statistics = render::make_method("full", model, {.threads = 1, .cancelled = {}})
                              ->render(scene, stage, frame);
  EXPECT_EQ(statistics.invalid_rays, 0U);
  return frame;
}

/// Returns the number of subpixels that differ by more than the last bit.
int differences(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  int count = 0;
  for (size_t k = 0; k < a.bytes().size(); ++k)
    if (std::abs(int{a.bytes()[k]} - int{b.bytes()[k]}) > 1) ++count;
  return count;
}

class Invariance : public ::testing::TestWithParam<NamedScene> {
 protected:
  const optics::Rig rig_ = make_rig({.width = 60, .height = 40, .pixel_mm = 1.0});
  const TinyStage home_{.centre = {0.1, 0.0, -0.2}, .mm_per_unit = 9.0, .turn_degrees = 11.0};
};

TEST_P(Invariance, PicturesDoNotDependOnUnits) {
  const frames::WovenFrame at_home = picture(GetParam().scene, make_tiny_stage(home_), rig_);
  for (const double scale : {1e-6, 1e-3, 7.0, 1e3, 1e6}) {
    TinyStage stage = home_;
    stage.centre = home_.centre * scale;
    stage.mm_per_unit = home_.mm_per_unit / scale;
    const frames::WovenFrame other =
        picture(moved(GetParam().scene, scale, {}), make_tiny_stage(stage), rig_);
    EXPECT_LE(differences(at_home, other), 2) << scale;
  }
}

TEST_P(Invariance, PicturesDoNotDependOnTheOrigin) {
  const frames::WovenFrame at_home = picture(GetParam().scene, make_tiny_stage(home_), rig_);
  for (const double distance : {1e3, 1e6, 1e7}) {
    const Vec3 offset{distance, -0.7 * distance, 0.4 * distance};
    TinyStage stage = home_;
    stage.centre = home_.centre + offset;
    const frames::WovenFrame other =
        picture(moved(GetParam().scene, 1.0, offset), make_tiny_stage(stage), rig_);
    EXPECT_LE(differences(at_home, other), 2) << distance;
  }
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, Invariance, ::testing::ValuesIn(tiny_scenes()),
                         [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace lenticule::test
