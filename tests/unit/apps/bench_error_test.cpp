// SPDX-License-Identifier: Apache-2.0
// Tests how `lenticule bench error` evaluates its measurements.

#include "apps/lenticule-bench/render/bench_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "frames/compare.h"
#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "render/methods/method.h"
#include "tests/support/noise_frame.h"

namespace lenticule::bench {
namespace {

optics::Rig sample_rig(const std::string& name) {
  return optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/" + name);
}

nlohmann::json frame_of(double wall) {
  return {{"wall_s", wall}, {"cpu_s", 2 * wall}, {"rays", 30}, {"subpixels", 10}, {"traced", 4}};
}

nlohmann::json frame_of(double wall, double mse, double flicker) {
  nlohmann::json frame = frame_of(wall);
  frame.update({{"mse", mse},
                {"max", static_cast<int>(mse)},
                {"share_over_e", mse / 100},
                {"share_over_8", 0.25},
                {"share_over_32", 0.125},
                {"worst_view_mse", 2 * mse},
                {"bound", 0.02}});
  for (const double eye : {0.0, 0.5})
    frame["eyes"].push_back({{"ssim", 1.0 - eye},
                             {"flip_mean", eye},
                             {"flip_p99", 2 * eye},
                             {"flicker_mean", flicker},
                             {"flicker_largest", 10 * flicker + eye}});
  return frame;
}

nlohmann::json small_scenario() {
  const auto method = [](const char* name, bool missing, std::vector<nlohmann::json> frames) {
    nlohmann::json one = {
        {"name", name}, {"method", name}, {"tolerated_error", nullptr}, {"missing", missing}};
    if (!missing) one["frames"] = frames;
    return one;
  };
  return {{"scene", "teapot"},
          {"rig", "small"},
          {"course", "moving"},
          {"subpixels", 10},
          {"copy_s", 0.5},
          {"pictures", nlohmann::json::array()},
          {"methods",
           {method("full", false, {frame_of(4), frame_of(2), frame_of(2)}),
            method("quick", false, {frame_of(4, 0, 0), frame_of(1, 1, 3), frame_of(1, 4, 5)}),
            method("gone", true, {})}}};
}

TEST(ErrorSummary, AddsUpTimes) {
  nlohmann::json scenario = small_scenario();
  summarize_errors(scenario, {{"ours_over_theirs", 1.5}});
  const nlohmann::json& m = scenario["methods"][1];
  EXPECT_DOUBLE_EQ(m["seconds_per_frame"], 2.0);
  EXPECT_DOUBLE_EQ(m["first_s"], 4.0);
  EXPECT_DOUBLE_EQ(m["later_s"], 1.0);
  EXPECT_DOUBLE_EQ(m["of_full"], 0.75);
  EXPECT_DOUBLE_EQ(m["saved"], 0.25);
  EXPECT_DOUBLE_EQ(m["later_saved"], 0.5);
  EXPECT_DOUBLE_EQ(m["cpu_of_full"], 0.75);
  EXPECT_DOUBLE_EQ(m["rays_per_subpixel"], 3.0);
  EXPECT_DOUBLE_EQ(m["over_copy"], 4.0);
  EXPECT_DOUBLE_EQ(m["over_tachyon"], 2.0) << "full has 1.5 times its rate, this takes 3/4 of it";
  EXPECT_DOUBLE_EQ(scenario["methods"][0]["over_tachyon"], 1.5);
  EXPECT_DOUBLE_EQ(scenario["methods"][0]["saved"], 0.0);
  EXPECT_FALSE(scenario["methods"][0].contains("psnr_mean_db"));
  EXPECT_FALSE(scenario["methods"][2].contains("seconds_per_frame"));
}

TEST(ErrorSummary, AddsUpErrorsAndLeavesEqualFramesOutOfTheMeanPsnr) {
  nlohmann::json scenario = small_scenario();
  summarize_errors(scenario, {});
  const nlohmann::json& m = scenario["methods"][1];
  const double of_one = 20.0 * std::log10(255.0);
  EXPECT_NEAR(m["psnr_mean_db"], of_one - 10.0 * std::log10(2.0), 1e-9);
  EXPECT_NEAR(m["psnr_worst_db"], of_one - 10.0 * std::log10(4.0), 1e-9);
  EXPECT_NEAR(m["worst_view_psnr_db"], of_one - 10.0 * std::log10(8.0), 1e-9);
  EXPECT_EQ(m["max"], 4);
  EXPECT_NEAR(m["share_over_e"], 0.05 / 3, 1e-12);
  EXPECT_DOUBLE_EQ(m["ssim_mean"], 0.75);
  EXPECT_DOUBLE_EQ(m["ssim_worst"], 0.5);
  EXPECT_DOUBLE_EQ(m["flip_mean"], 0.25);
  EXPECT_DOUBLE_EQ(m["flip_p99_worst"], 1.0);
  EXPECT_DOUBLE_EQ(m["flicker_mean"], 4.0) << "the first frame has nothing before it";
  EXPECT_DOUBLE_EQ(m["flicker_largest"], 50.5);
  EXPECT_EQ(m["bound"]["frames"], 3);
  EXPECT_NEAR(m["bound"]["within_percent"], 200.0 / 3, 1e-9);
  EXPECT_TRUE(m["over_tachyon"].is_null());

  const nlohmann::json all = bound_of_all({scenario, scenario});
  EXPECT_EQ(all["frames"], 6);
  EXPECT_NEAR(all["within_percent"], 200.0 / 3, 1e-9);
  EXPECT_NEAR(all["largest_excess"], 0.02, 1e-12) << "0.04 beyond, 0.02 said";
  EXPECT_TRUE(bound_of_all(nlohmann::json::array()).is_null());
}

TEST(SeenPixels, PerDegreeFollowFromTheViewingDistance) {
  const optics::Rig rig = sample_rig("kiosk-27-4k.toml");
  // A lens is 7.701 / 3 pixels of 0.15567 mm wide; a degree is 12.217 mm at 700 mm.
  EXPECT_NEAR(seen_pixels_per_degree(rig), 12.2173 / (7.701 / 3 * 0.15567), 0.01);
  optics::Rig parallel = rig;
  parallel.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  EXPECT_NEAR(seen_pixels_per_degree(parallel), 67.02, 0.01);
}

// ---- measured on the smallest rig

nlohmann::json measured(const std::string& scene, ErrorScenario scenario, int runs) {
  const ErrorSetup setup = {
      .rig = sample_rig("tiny.toml"),
      .entrants = error_entrants({"lens-view", "full", "temporal", "none-such"}, {}, {},
                                 render::method_names()),
      .scenario = scenario,
      .frames = 3,
      .threads = 1,
      .runs = runs};
  int done = 0;
  nlohmann::json result = measure_error(setup, ErrorScene(scene), [&] { ++done; });
  EXPECT_EQ(done, scenario == ErrorScenario::Still ? 2 * 3 : 3 * 3);
  return result;
}

void expect_figures_of_single_frames(ErrorScenario which, double turned_by_degrees) {
  const nlohmann::json scenario = measured("tree:3", which, 2);
  ASSERT_EQ(scenario["methods"].size(), 4U);
  EXPECT_TRUE(scenario["methods"][3]["missing"].get<bool>());
  ASSERT_EQ(scenario["methods"][1]["frames"].size(), 3U);

  const optics::OpticalModel model(sample_rig("tiny.toml"));
  const ErrorScene scene("tree:3");
  render::RenderOptions options;
  options.threads = 1;
  const tools::StageSequence stages(scene.after(0), render::canvas_of(model), {},
                                    turned_by_degrees);
  frames::WovenFrame full({.width = 48, .height = 32});
  frames::WovenFrame test = full;
  for (size_t n = 0; n < 3; ++n) {
    const render::SceneDescription description =
        which == ErrorScenario::Objects ? with_moving_objects(scene.after(0), n) : scene.after(n);
    const render::Stage stage = stages.at(description, static_cast<double>(n) / 3.0);
    const render::Scene committed(description, stage, {}, 1);
    (void)render::make_method("full", model, options)->render(committed, stage, full);
    (void)render::make_method("lens-view", model, options)->render(committed, stage, test);
    const auto off = frames::compare_pictures(full.view(), test.view()).total;
    const nlohmann::json& figures = scenario["methods"][1]["frames"][n];
    EXPECT_DOUBLE_EQ(figures["mse"], off.mse());
    EXPECT_EQ(figures["max"], off.max());
    EXPECT_DOUBLE_EQ(figures["share_over_8"], off.share_over(8));
    const auto views = frames::compare_views(full.view(), test.view(), model, 8);
    EXPECT_DOUBLE_EQ(figures["worst_view_mse"],
                     views[static_cast<size_t>(frames::worst_view(views))].mse());
    EXPECT_EQ(figures["eyes"].size(), 3U);
    EXPECT_EQ(figures["subpixels"], 48 * 32 * 3);
  }
}

TEST(ErrorScenarios, FiguresAgreeWithFramesMeasuredOneByOne) {
  expect_figures_of_single_frames(ErrorScenario::Moving, 0.0);
}

TEST(ErrorScenarios, ATurningSceneTurnsOnceOverItsFrames) {
  expect_figures_of_single_frames(ErrorScenario::Turning, 360.0);
}

TEST(ErrorScenarios, ObjectsMoveBeforeTheCameraOfTheFirstFrame) {
  expect_figures_of_single_frames(ErrorScenario::Objects, 0.0);
}

TEST(ErrorScenarios, AThirdOfTheSmallObjectsAndALightMove) {
  const render::SceneDescription still = ErrorScene("tree:3").after(0);
  const render::SceneDescription now = with_moving_objects(still, 4);
  const render::SceneDescription next = with_moving_objects(still, 5);
  const auto moved = std::ranges::count_if(now.cones, [&](const render::Cone& cone) {
    return cone.base != next.cones.at(static_cast<size_t>(&cone - now.cones.data())).base;
  });
  EXPECT_NEAR(static_cast<double>(moved), static_cast<double>(now.cones.size()) / 3.0, 2.0);
  EXPECT_NE(now.lights.at(0).position, next.lights.at(0).position);
  EXPECT_EQ(now.lights.at(1).position, next.lights.at(1).position);
  EXPECT_EQ(now.cameras.at(0).from, still.cameras.at(0).from);
}

TEST(ErrorScenarios, TheOnlyObjectMovesInTheLightThatItGets) {
  render::SceneDescription ball;
  ball.spheres = {{.radius = 1.0}};
  EXPECT_NE(with_moving_objects(ball, 1).spheres[0].centre,
            with_moving_objects(ball, 2).spheres[0].centre);
  EXPECT_NE(with_moving_objects(ball, 1).lights.at(0).position,
            with_moving_objects(ball, 2).lights.at(0).position);
}

// ---- pictures

TEST(TileSheet, ShowsTheTileAndTheEyesView) {
  const frames::WovenFrame a = test::noise_frame(200, 100, 1);
  const frames::WovenFrame b = test::noise_frame(200, 100, 2);
  const frames::WovenFrame eye_a = test::noise_frame(50, 20, 3);
  const frames::WovenFrame eye_b = test::noise_frame(50, 20, 4);
  const lab::Tile tile{.x = 40, .y = 0, .width = 96, .height = 96, .mse = 1.0};
  const frames::WovenFrame sheet = tile_sheet(a.view(), b.view(), eye_a.view(), eye_b.view(), tile);
  EXPECT_EQ(sheet.width(), 3 * 384 + 2 * 8);
  EXPECT_EQ(sheet.height(), 2 * 384 + 8);
  const frames::WovenFrame heat = frames::error_picture(a.view(), b.view());
  for (int j = 0; j < 384; j += 5)
    for (int i = 0; i < 384; i += 5)
      for (int c = 0; c < 3; ++c) {
        const int from = 3 * (40 + i / 4) + c;
        ASSERT_EQ(sheet.row(j)[3 * i + c], a.row(j / 4)[from]);
        ASSERT_EQ(sheet.row(j)[3 * (i + 392) + c], b.row(j / 4)[from]);
        ASSERT_EQ(sheet.row(j)[3 * (i + 784) + c], heat.row(j / 4)[from]);
        // The panel's pixel 40 is the eye's pixel 10: four panel pixels per eye pixel.
        const int seen_i = static_cast<int>((40 + (i + 0.5) / 4) / 4);
        const int seen_j = static_cast<int>((j + 0.5) / 4 / 5);
        ASSERT_EQ(sheet.row(392 + j)[3 * i + c], eye_a.row(seen_j)[3 * seen_i + c]);
        ASSERT_EQ(sheet.row(392 + j)[3 * (i + 392) + c], eye_b.row(seen_j)[3 * seen_i + c]);
      }
}

TEST(WorstPlaces, KeepsTheWorstPlacesOfAllFramesWithoutDuplicates) {
  const frames::WovenFrame full({.width = 500, .height = 100});
  SeenPictures seen;
  seen.fill(frames::WovenFrame({.width = 50, .height = 10}));
  SeenPictures seen_test = seen;
  std::ranges::fill(seen_test[2].bytes(), uint8_t{99});  // every pixel is wrong for the right eye
  const auto off = [&](std::initializer_list<std::pair<int, int>> places) {
    frames::WovenFrame frame = full;
    for (const auto& [x, levels] : places) frame.row(50)[3 * x] = static_cast<uint8_t>(levels);
    return frame;
  };
  WorstPlaces places;
  places.add(0, full.view(), off({{50, 10}, {250, 20}}).view(), seen, seen_test);
  places.add(1, full.view(), off({{50, 200}, {250, 5}, {450, 1}}).view(), seen, seen_test);
  const lab::ScratchFolder folder;
  const nlohmann::json written = places.write(folder.file("worst"), "tree:3 x");
  ASSERT_EQ(written.size(), 3U);
  const std::array<std::pair<int, int>, 3> expected = {{{1, 50}, {0, 250}, {1, 450}}};
  for (size_t n = 0; n < expected.size(); ++n) {
    EXPECT_EQ(written[n]["frame"], expected[n].first);
    EXPECT_LE(written[n]["x"].get<int>(), expected[n].second);
    EXPECT_GT(written[n]["x"].get<int>() + 96, expected[n].second);
    EXPECT_EQ(written[n]["eye"], 2);
    const std::string file = folder.file("worst/tree-3-x-" + std::to_string(n + 1) + ".png");
    EXPECT_EQ(written[n]["file"], file);
    EXPECT_EQ(frames::probe_image(file).width, 3 * 384 + 16);
  }
}

TEST(ErrorEyes, SeeNoDifferenceBetweenEqualFramesOnly) {
  const optics::OpticalModel model(sample_rig("tiny.toml"));
  WorkerThreads workers(2);
  ErrorEyes eyes(model, workers);
  EyeFlicker flicker;
  const frames::WovenFrame a = test::noise_frame(48, 32, 1);
  eyes.set_reference(a.view());
  for (const nlohmann::json& eye : eyes.compare(a.view(), flicker)) {
    EXPECT_NEAR(eye["ssim"], 1.0, 1e-12);
    EXPECT_EQ(eye["flip_mean"], 0.0);
    EXPECT_EQ(eye["flip_p99"], 0.0);
  }
  const nlohmann::json unlike = eyes.compare(test::noise_frame(48, 32, 2).view(), flicker);
  ASSERT_EQ(unlike.size(), 3U);
  for (const nlohmann::json& eye : unlike) {
    EXPECT_LT(eye["ssim"].get<double>(), 0.5);
    EXPECT_GT(eye["flip_mean"].get<double>(), 0.1);
    EXPECT_GT(eye["flicker_largest"].get<int>(), 20) << "there was no error before";
  }
  EXPECT_NE(eyes.test()[0], eyes.test()[2]) << "the eyes see different views";
}

}  // namespace
}  // namespace lenticule::bench
