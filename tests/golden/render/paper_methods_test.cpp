// SPDX-License-Identifier: Apache-2.0
// Tests the paper's methods on its scenes: their deviation from `full`, that they reuse points, and
// that their statistics add up.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "apps/lenticule-bench/render/bench_paper.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "frames/compare.h"
#include "render/methods/method.h"
#include "scenes/scene_list.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::test {
namespace {

constexpr int kFirstFrame = 96;
constexpr int kFrames = 3;

/// The least PSNR of the last frame: about a decibel below the value measured when the test was
/// written.
struct Expected {
  const char* scene;
  int size;
  double lens_view_db, interpolate_db, temporal_db, hybrid_db;
};

struct Made {
  frames::WovenFrame frame;
  render::RenderStatistics statistics;
};

/// Returns the last of a few frames of the scene's camera path.
Made last_frame(const Expected& expected, const optics::OpticalModel& model, const char* name) {
  const scenes::BuiltInScene& scene = scenes::find_scene(expected.scene);
  render::RenderOptions options;
  options.threads = 2;
  options.max_depth = 2;
  const auto method = render::make_method(name, model, options);
  Made made{frames::WovenFrame({model.rig().panel.width_px, model.rig().panel.height_px}), {}};
  for (int n = kFirstFrame; n < kFirstFrame + kFrames; ++n) {
    const render::SceneDescription description = tools::describe_built_in(scene, expected.size, n);
    const render::Stage stage = render::make_stage(description, model, {.whole_depth = true});
    method->set_frame(static_cast<uint64_t>(n));
    made.statistics = method->render(render::Scene(description, stage, {}), stage, made.frame);
  }
  return made;
}

class PaperMethods : public ::testing::TestWithParam<Expected> {};

TEST_P(PaperMethods, KeepTheirQuality) {
  const Expected& expected = GetParam();
  const optics::OpticalModel model(make_rig({.width = 240,
                                             .height = 96,
                                             .pitch_subpx = 24.0,
                                             .slant = 0.0,
                                             .distance_mm = std::numeric_limits<double>::infinity(),
                                             .pixel_mm = 0.25}));
  const Made full = last_frame(expected, model, "full");
  EXPECT_EQ(full.statistics.traced_subpixels, full.statistics.subpixels);
  const auto check = [&](const char* method, double least_db) {
    const Made made = last_frame(expected, model, method);
    const render::RenderStatistics& s = made.statistics;
    EXPECT_EQ(s.traced_subpixels + s.projected_subpixels + s.interpolated_subpixels, s.subpixels);
    const double psnr = frames::compare_pictures(full.frame.view(), made.frame.view())
                            .total.psnr_db()
                            .value_or(99.0);
    const double reused =
        1.0 - static_cast<double>(s.traced_subpixels) / static_cast<double>(s.subpixels);
    std::printf("%-12s %-12s %6.2f dB, %4.1f %% reused\n", expected.scene, method, psnr,
                100.0 * reused);
    EXPECT_GE(psnr, least_db) << method;
    EXPECT_GE(reused, 0.1) << method;
  };
  check("lens-view", expected.lens_view_db);
  check("interpolate", expected.interpolate_db);
  check("temporal", expected.temporal_db);
  check("hybrid", expected.hybrid_db);
}

INSTANTIATE_TEST_SUITE_P(Scenes, PaperMethods,
                         ::testing::Values(Expected{"teapot", 2, 43.5, 33.0, 34.5, 34.0},
                                           Expected{"room", 2, 37.0, 28.0, 26.5, 26.0},
                                           Expected{"small-balls", 1, 35.5, 19.0, 29.0, 28.5},
                                           Expected{"primitives", 2, 38.0, 21.5, 28.0, 28.0},
                                           Expected{"tree", 4, 49.0, 32.0, 38.5, 38.0},
                                           Expected{"gears", 1, 49.0, 33.5, 31.5, 31.5}),
                         [](const auto& instance) {
                           std::string name = instance.param.scene;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(PaperMethods, AreTestedOnEverySceneOfThePaper) {
  EXPECT_EQ(bench::published_times().size(), 6U);
}

}  // namespace
}  // namespace lenticule::test
