// SPDX-License-Identifier: Apache-2.0
// Tests the methods that reuse points: re-projection against its reference, counters, depth order,
// and the invariances of a sequence.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "optics/eye_simulator.h"
#include "render/accel/denormals.h"
#include "render/methods/method.h"
#include "render/methods/reuse/micro_image_sweep.h"
#include "tests/support/oracles/reprojection_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using reprojection::Column;
using test::make_rig;
using test::make_tiny_stage;

const std::vector<std::string>& reusing_methods() {
  static const std::vector<std::string> names = {"lens-view", "interpolate", "temporal", "hybrid"};
  return names;
}

optics::Rig small_rig(double pitch = 24.0, double slant = 0.0) {
  return make_rig(
      {.width = 120, .height = 50, .pitch_subpx = pitch, .slant = slant, .pixel_mm = 0.5});
}

frames::WovenFrame blank(const optics::Rig& rig) {
  return frames::WovenFrame({rig.panel.width_px, rig.panel.height_px});
}

/// A sequence; the stage of frame n is turned n times.
struct Rendered {
  std::vector<frames::WovenFrame> frames;
  std::vector<RenderStatistics> statistics;
};
Rendered rendered(const std::string& name, const SceneDescription& description,
                  const optics::Rig& rig, const std::vector<Stage>& stages,
                  const RenderOptions& options = {}) {
  const optics::OpticalModel model(rig);
  const auto method = make_method(name, model, options);
  Rendered result;
  for (const Stage& stage : stages) {
    const Scene scene(description, stage, {}, options.threads);
    result.frames.push_back(blank(rig));
    result.statistics.push_back(method->render(scene, stage, result.frames.back()));
  }
  return result;
}

std::vector<Stage> turning(int frames, double degrees = 0.4) {
  std::vector<Stage> stages;
  for (int n = 0; n < frames; ++n)
    stages.push_back(make_tiny_stage({.mm_per_unit = 6.0, .turn_degrees = degrees * n}));
  return stages;
}

struct Agreement {
  int compared = 0;
  int known = 0;
};

/// Looks up every subpixel of a traced tile under the lens at its left, with the kernel and with
/// the reference.
Agreement compare_with_oracle(const SceneDescription& description, const optics::Rig& rig) {
  const optics::OpticalModel model(rig);
  const RenderOptions options;
  const SweepPlan plan(model, options);
  MicroImageSweep sweep(plan, options);
  const Stage stage = make_tiny_stage();
  const Scene scene(description, stage, {});
  const Tile tile = plan.tiles.tile(0);
  const FlushDenormals flush;
  sweep.start(scene, tile);
  sweep.trace_empty();
  const std::span<Column> columns = sweep.columns();
  for (size_t c = 3; c < columns.size(); ++c)
    plan.kernel.join(columns[c - 3], plan.rules, columns[c]);

  Agreement agreement;
  for (int lane = 0; lane < tile.rows; ++lane)
    for (int channel = 0; channel < 3; ++channel) {
      std::vector<test::SeenPoint> points(static_cast<size_t>(rig.panel.width_px));
      std::vector<int> column_of(points.size(), -1);
      for (int c = 0; c < tile.columns; ++c) {
        const int s = plan.tiles.subpixel(tile, c, lane);
        if (s < 0 || s >= plan.tiles.row_subpixels() || s % 3 != channel) continue;
        const Column& column = columns[static_cast<size_t>(c)];
        points[static_cast<size_t>(s / 3)] = {.there = true,
                                              .z_mm = double{column.z[lane]},
                                              .code = double{column.code[lane]},
                                              .surface = column.surface[lane]};
        column_of[static_cast<size_t>(s / 3)] = c;
      }
      for (int i = 0; i < rig.panel.width_px; ++i) {
        const int c = column_of[static_cast<size_t>(i)];
        if (c < 0) continue;
        const optics::SubpixelRay ray = model.ray(i, tile.row_begin + lane, channel);
        const Column& column = columns[static_cast<size_t>(c)];
        EXPECT_EQ(column.lens[lane], ray.lens);
        EXPECT_NEAR(column.panel_x[lane], ray.lens_x_mm, 1e-3);
        EXPECT_NEAR(column.tan[lane], ray.tan_x, 1e-5);
        const test::FoundPoint expected = test::oracle_on_chords(
            model, tile.row_begin + lane, channel, points, i, static_cast<long>(ray.lens) - 1, {});
        if (expected.margin == 0.0) continue;
        alignas(64) std::array<int32_t, kPacket> wanted;
        wanted.fill(column.lens[lane] - 1);
        reprojection::Found found;
        plan.kernel.on_chords(columns.data(), c % 3, tile.columns, wanted.data(), column,
                              plan.rules, found);
        ++agreement.compared;
        EXPECT_EQ(found.known[lane] != 0, expected.known) << i << " " << lane << " " << channel;
        if (!expected.known || found.known[lane] == 0) continue;
        ++agreement.known;
        EXPECT_NEAR(found.z[lane], expected.z_mm, 2e-3 * (1.0 + std::abs(expected.z_mm)));
        EXPECT_NEAR(found.code[lane], expected.code, 0.5);
      }
    }
  return agreement;
}

TEST(Reprojection, AgreesWithTheReference) {
  Agreement all;
  for (const test::NamedScene& named : test::tiny_scenes())
    for (const double pitch : {7.7, 24.0, 31.3})
      for (const double slant : {0.0, 1.0 / 3.0, -0.21})
        for (const char* layout : {"rgb", "bgr"}) {
          const Agreement one = compare_with_oracle(named.scene, make_rig({.width = 60,
                                                                           .height = 10,
                                                                           .pitch_subpx = pitch,
                                                                           .slant = slant,
                                                                           .layout = layout,
                                                                           .pixel_mm = 1.0}));
          all.compared += one.compared;
          all.known += one.known;
        }
  EXPECT_GT(all.compared, 100'000);
  EXPECT_GT(all.known, all.compared / 10);
}

TEST(ReuseMethods, CountEverySubpixelOnce) {
  const SceneDescription scene = test::tiny_scenes().front().scene;
  for (const std::string& name : reusing_methods())
    for (const double slant : {0.0, 0.3}) {
      const optics::Rig rig = small_rig(slant == 0.0 ? 24.0 : 7.7, slant);
      const optics::OpticalModel model(rig);
      const auto method = make_method(name, model, {.keep_missing = true, .cancelled = {}});
      for (const Stage& stage : turning(3)) {
        const Scene committed(scene, stage, {});
        frames::WovenFrame frame = blank(rig);
        const RenderStatistics s = method->render(committed, stage, frame);
        EXPECT_EQ(s.subpixels, frame.bytes().size());
        EXPECT_EQ(s.traced_subpixels + s.projected_subpixels + s.interpolated_subpixels,
                  s.subpixels);
        EXPECT_EQ(s.primary_rays, s.traced_subpixels) << name;
        ASSERT_NE(method->missing_subpixels(), nullptr);
        const auto missing = method->missing_subpixels()->bytes();
        EXPECT_EQ(static_cast<uint64_t>(std::ranges::count(missing, 255)), s.missing_subpixels);
      }
    }
}

TEST(ReuseMethods, GiveTheSameBytesWithAnyNumberOfThreadsAndInstructionSet) {
  for (const test::NamedScene& named : test::tiny_scenes())
    for (const std::string& name : reusing_methods()) {
      const optics::Rig rig = small_rig(7.7, 1.0 / 3.0);
      const std::vector<Stage> stages = turning(3);
      const Rendered one =
          rendered(name, named.scene, rig, stages, {.threads = 1, .cancelled = {}});
      for (const int threads : {2, 8})
        EXPECT_EQ(
            one.frames,
            rendered(name, named.scene, rig, stages, {.threads = threads, .cancelled = {}}).frames)
            << name << ", " << named.name << ", " << threads;
      EXPECT_EQ(one.frames, rendered(name, named.scene, rig, stages,
                                     {.threads = 1, .isa = Isa::Baseline, .cancelled = {}})
                                .frames)
          << name << ", " << named.name;
    }
}

/// Frames without motion are not changed.
TEST(ReuseMethods, OverTimeKeepStillPictures) {
  const SceneDescription scene = test::tiny_scenes().front().scene;
  const optics::Rig rig = small_rig();
  const std::vector<Stage> stages(4, make_tiny_stage());
  for (const char* name : {"temporal", "hybrid"}) {
    const Rendered still = rendered(name, scene, rig, stages);
    for (const frames::WovenFrame& frame : still.frames) EXPECT_EQ(frame, still.frames[0]) << name;
    EXPECT_EQ(still.statistics[3].traced_subpixels, 0U);
  }
}

TEST(ReuseMethods, OverTimeRestartAfterACut) {
  const SceneDescription scene = test::tiny_scenes().front().scene;
  const optics::Rig rig = small_rig();
  const std::vector<Stage> stages = {make_tiny_stage({.mm_per_unit = 6.0}),
                                     make_tiny_stage({.mm_per_unit = 6.0, .turn_degrees = 0.3}),
                                     make_tiny_stage({.mm_per_unit = 6.0, .turn_degrees = 50.0})};
  const Rendered cut = rendered("temporal", scene, rig, stages);
  EXPECT_GT(cut.statistics[1].projected_subpixels, cut.statistics[1].subpixels / 4);
  EXPECT_EQ(cut.statistics[2].projected_subpixels, 0U);
  EXPECT_EQ(cut.frames[2], rendered("full", scene, rig, {stages[2]}).frames[0]);
}

TEST(ReuseMethods, OverTimeRestartWhenAnObjectMoves) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  const Stage stage = make_tiny_stage();
  SceneDescription scene = test::tiny_scenes().front().scene;
  const auto method = make_method("temporal", model, {});
  frames::WovenFrame frame = blank(rig);
  method->render(Scene(scene, stage, {}), stage, frame);
  scene.spheres.push_back({.centre = {1, 1, 1}, .radius = 0.5, .inward = false, .material = 0});
  const RenderStatistics s = method->render(Scene(scene, stage, {}), stage, frame);
  EXPECT_EQ(s.traced_subpixels, s.subpixels);
  EXPECT_EQ(frame, rendered("full", scene, rig, {stage}).frames[0]);
}

/// A frame made from earlier frames names them; without them the frame differs.
TEST(ReuseMethods, OverTimeNeedTheFramesSinceTheLastKeyFrame) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  const auto temporal = make_method("temporal", model, {});
  EXPECT_EQ(temporal->first_needed(35), 32U);
  EXPECT_EQ(temporal->first_needed(48), 48U);
  EXPECT_EQ(make_method("lens-view", model, {})->first_needed(35), 35U);

  const SceneDescription scene = test::tiny_scenes().front().scene;
  const std::vector<Stage> stages = turning(5);
  const Rendered whole = rendered("temporal", scene, rig, stages);
  frames::WovenFrame frame = blank(rig);
  for (uint64_t n = temporal->first_needed(4); n <= 4; ++n) {
    temporal->set_frame(n);
    temporal->render(Scene(scene, stages[n], {}), stages[n], frame);
  }
  EXPECT_EQ(temporal->first_needed(5), 5U);
  EXPECT_EQ(frame, whole.frames[4]);
}

/// A red pane before a blue wall: wherever an eye sees red in and around a place of the exact
/// picture, it sees red in the others, and the same for blue.
TEST(ReuseMethods, KeepTheOrderOfDepth) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {Material{.name = "red", .colour = {1, 0, 0}},
                     Material{.name = "blue", .colour = {0, 0, 1}}};
  scene.meshes = {test::rectangle_mesh({-1.5, -1, 1}, {3, 0, 0}, {0, 2, 0}, 0),
                  test::rectangle_mesh({-50, -50, -3}, {100, 0, 0}, {0, 100, 0}, 1)};
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  const std::vector<Stage> stages = turning(3);
  const auto seen = [&](const frames::WovenFrame& frame, double x) {
    return optics::simulate_eye(model,
                                {.pixels = frame.row(0),
                                 .width = frame.width(),
                                 .height = frame.height(),
                                 .stride_bytes = frame.geometry().row_bytes()},
                                {.x = x, .y = 0.0, .z_mm = 700.0});
  };
  for (const std::string& name : reusing_methods()) {
    const Rendered made = rendered(name, scene, rig, stages);
    EXPECT_GT(made.statistics[2].projected_subpixels, made.statistics[2].subpixels / 5) << name;
    const Rendered full = rendered("full", scene, rig, stages);
    for (const double x : {-100.0, 0.0, 90.0}) {
      const optics::RgbPicture expected = seen(full.frames[2], x);
      const optics::RgbPicture actual = seen(made.frames[2], x);
      int compared = 0, swapped = 0;
      // The margin is one lens wide, where both pictures have edges.
      constexpr int kMargin = 5;
      for (int j = 1; j + 1 < expected.height; ++j)
        for (int i = kMargin; i + kMargin < expected.width; ++i) {
          const auto red = [&](const optics::RgbPicture& p, int at, int row) {
            const uint8_t* pixel = &p.pixels[3 * static_cast<size_t>(row * p.width + at)];
            return pixel[0] > pixel[2];
          };
          bool uniform = true;
          for (int k = -kMargin; k <= kMargin; ++k)
            for (const int row : {j - 1, j, j + 1})
              uniform = uniform && red(expected, i + k, row) == red(expected, i, j);
          if (!uniform) continue;
          ++compared;
          swapped += red(actual, i, j) != red(expected, i, j) ? 1 : 0;
        }
      EXPECT_GT(compared, 200);
      EXPECT_EQ(swapped, 0) << name << " from " << x;
    }
  }
}

/// A pane approaches by a tenth of a row per frame: its outlines grow over the background, and the
/// parts that enter at the panel's border were in no frame before.
TEST(ReuseMethods, OverTimeOutlinesFollowSlowObjects) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  scene.background = {0, 0, 1};
  scene.materials = {Material{.name = "red", .colour = {1, 0, 0}}};
  scene.meshes = {test::rectangle_mesh({-1.5, -1, 0}, {3, 0, 0}, {0, 1, 0}, 0),
                  test::rectangle_mesh({-9, 2.1, 0}, {18, 0, 0}, {0, 9, 0}, 0)};
  const optics::Rig rig = small_rig();
  std::vector<Stage> stages;
  for (int n = 0; n < 15; ++n)
    stages.push_back(make_tiny_stage({.centre = {0, 0.01 * n, 0}, .mm_per_unit = 6.0}));
  const Rendered full = rendered("full", scene, rig, stages);
  for (const char* name : {"temporal", "hybrid"}) {
    const Rendered made = rendered(name, scene, rig, stages);
    EXPECT_GT(made.statistics.back().projected_subpixels, full.frames.back().bytes().size() / 3);
    for (size_t n = 0; n < stages.size(); ++n) {
      int strange = 0;
      for (int j = 0; j < rig.panel.height_px; ++j)
        for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
          bool shown = false;  // within one row, where outlines may lie
          for (const int row : {j - 1, j, j + 1})
            shown = shown || (row >= 0 && row < rig.panel.height_px &&
                              full.frames[n].row(row)[s] == made.frames[n].row(j)[s]);
          strange += shown ? 0 : 1;
        }
      EXPECT_EQ(strange, 0) << name << " frame " << n;
    }
  }
}

TEST(ReuseMethods, AllowOneSampleOnly) {
  const optics::OpticalModel model(small_rig());
  for (const std::string& name : reusing_methods())
    EXPECT_THROW((void)make_method(name, model, {.samples = 4, .cancelled = {}}), Error);
}

TEST(EveryMethod, EndsEarlyWhenCancelled) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  for (const std::string& name : method_names()) {
    const auto method = make_method(name, model, {.cancelled = [] { return true; }});
    const Scene scene(test::tiny_scenes().front().scene, make_tiny_stage(), {});
    frames::WovenFrame frame = blank(rig);
    EXPECT_FALSE(method->render(scene, make_tiny_stage(), frame).completed);
  }
}

}  // namespace
}  // namespace lenticule::render
