// SPDX-License-Identifier: Apache-2.0
// Tests the methods that reuse points against method full: their deviation, and that they reuse
// points.
#include <gtest/gtest.h>

#include "frames/compare.h"
#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

struct Limits {
  const char* method;
  double psnr_db;
  double reused;
};

class ReuseQuality : public ::testing::TestWithParam<NamedScene> {};

/// Measures the third frame of a turning scene, on upright and on slanted lenses.
TEST_P(ReuseQuality, DoesNotDecrease) {
  for (const double slant : {0.0, 0.25}) {
    const optics::Rig rig = make_rig({.width = 240,
                                      .height = 96,
                                      .pitch_subpx = slant == 0.0 ? 24.0 : 13.4,
                                      .slant = slant,
                                      .pixel_mm = 0.25});
    const optics::OpticalModel model(rig);
    const auto full = render::make_method("full", model, {});
    for (const Limits& limits : {Limits{"lens-view", 25.0, 0.1}, Limits{"interpolate", 22.0, 0.2},
                                 Limits{"temporal", 21.0, 0.15}, Limits{"hybrid", 21.0, 0.15}}) {
      const auto method = render::make_method(limits.method, model, {});
      frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
      render::RenderStatistics statistics;
      render::Stage stage;
      for (int n = 0; n < 3; ++n) {
        stage = make_tiny_stage({.mm_per_unit = 6.0, .turn_degrees = 0.3 * n});
        statistics = method->render(render::Scene(GetParam().scene, stage, {}), stage, frame);
      }
      frames::WovenFrame reference(frame.geometry());
      (void)full->render(render::Scene(GetParam().scene, stage, {}), stage, reference);
      const auto total = frames::compare_pictures(reference.view(), frame.view()).total;
      const double psnr = total.psnr_db().value_or(99.0);
      const double reused = 1.0 - static_cast<double>(statistics.traced_subpixels) /
                                      static_cast<double>(statistics.subpixels);
      EXPECT_GE(psnr, limits.psnr_db) << limits.method << ", slant " << slant;
      EXPECT_GE(reused, limits.reused) << limits.method << ", slant " << slant;
      std::printf("%-12s slant %.2f %-12s %6.2f dB, %4.1f %% reused\n", GetParam().name.c_str(),
                  slant, limits.method, psnr, 100.0 * reused);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, ReuseQuality, ::testing::ValuesIn(tiny_scenes()),
                         [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace lenticule::test
