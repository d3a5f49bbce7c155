// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/scene_sequence.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <optional>

#include "base/error.h"
#include "render/scene/scene.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::tools {
namespace {

TEST(FrameRange, IsHalfOpenOrOneFrame) {
  EXPECT_EQ(player::parse_frame_range("3:7").begin, 3U);
  EXPECT_EQ(player::parse_frame_range("3:7").end, 7U);
  EXPECT_EQ(player::parse_frame_range("5").begin, 5U);
  EXPECT_EQ(player::parse_frame_range("5").count(), 1U);
  for (const char* text :
       {"", ":", "1:", ":2", "2:2", "3:1", "-1:2", "a:b", "1:2:3", "1.5", "0:99999999999999999999"})
    EXPECT_THROW((void)player::parse_frame_range(text), Error) << text;
}

TEST(SceneSequence, RepeatsBuiltInScenesAfterTheirLastFrame) {
  const SceneSequence demo("builtin:demo", frames::Rate{});
  EXPECT_FALSE(demo.still());
  const auto period = static_cast<uint64_t>(scenes::find_scene("demo").frames);
  ASSERT_GT(period, 1U);
  const auto positions = [&](uint64_t frame) { return demo.at(frame).meshes.at(0).positions; };
  EXPECT_EQ(positions(1), positions(1 + period));
}

TEST(SceneSequence, RefusesUnknownScenesAndSizes) {
  for (const char* name : {"builtin:nothing", "builtin:teapot:0x",
                           "builtin:teapot:", "builtin:teapot:999999999", "builtin:"})
    EXPECT_THROW(SceneSequence(name, frames::Rate{}), Error) << name;
}

class NumberedScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const int number : {3, 4, 6}) {
      std::ofstream file(folder_ / ("s-0" + std::to_string(number) + ".nff"));
      file << "f 1 1 1 1 0 0 0 1\ns " << number << " 0 0 1\n";
    }
  }

  [[nodiscard]] std::string pattern() const { return (folder_ / "s-%02d.nff").string(); }

  test::ScratchFolder folder_;
};

TEST_F(NumberedScenes, AreLoadedFrameByFrame) {
  const SceneSequence scenes(pattern(), frames::Rate{});
  EXPECT_FALSE(scenes.still());
  EXPECT_EQ(scenes.reference_frame(), 3U);
  EXPECT_EQ(scenes.at(4).spheres.at(0).centre.x, 4.0);
}

TEST_F(NumberedScenes, MustAllExist) {
  const SceneSequence scenes(pattern(), frames::Rate{});
  EXPECT_NO_THROW(scenes.require({3, 5}));
  const Error error = test::error_of([&] { scenes.require({3, 7}); });
  EXPECT_NE(std::string(error.what()).find("s-05.nff"), std::string::npos);
  EXPECT_THROW(SceneSequence((folder_ / "t-%02d.nff").string(), frames::Rate{}), Error);
}

TEST(StageSequence, TheCamerasOfBuiltInFilmsKeepTheSceneCommitted) {
  const optics::OpticalModel model(test::make_rig({}));
  for (const char* name : {"tree", "room"}) {
    const SceneSequence scenes(fmt::format("builtin:{}:2", name), frames::Rate{});
    const StageSequence stages(scenes.at(0), render::canvas_of(model), {});
    render::SceneKeeper keeper({}, 1);
    std::optional<render::SceneFrame> last;
    render::Fingerprint described;
    int commits = 0;
    for (int n = 0; n < scenes::find_scene(name).frames; n += 3) {
      const auto scene =
          std::make_shared<const render::SceneDescription>(scenes.at(static_cast<uint64_t>(n)));
      const render::Scene& committed = keeper.commit(scene, stages.at(*scene));
      commits += committed.frame != last || committed.described != described ? 1 : 0;
      last = committed.frame;
      described = committed.described;
    }
    EXPECT_LE(commits, 2) << name;
  }
}

TEST(StageSequence, KeepsDepthAndPlaceFromFrameToFrame) {
  const optics::OpticalModel model(test::make_rig({}));
  render::SceneDescription scene;
  scene.materials = {render::Material{}};
  scene.spheres = {{.centre = {0, 0, 0}, .radius = 1}};
  const StageSequence stages(scene, render::canvas_of(model), {});
  scene.spheres[0].centre = {1, 2, 3};  // the sphere moves; the stage must stay
  const render::Stage later = stages.at(scene);
  EXPECT_EQ(later.mm_per_unit, stages.reference().mm_per_unit);
  EXPECT_EQ(later.panel_from_world.origin, stages.reference().panel_from_world.origin);
  ASSERT_TRUE(later.ground);
  EXPECT_EQ(later.ground->y, -1.0);
  EXPECT_EQ(later.ground->size, 2.0);

  render::Camera camera;
  camera.from = {0, 0, 10};
  scene.cameras = {camera};
  const StageSequence filmed(scene, render::canvas_of(model), {});
  scene.cameras[0].from = {3, 0, 10};
  EXPECT_EQ(filmed.at(scene).depth_scale, filmed.reference().depth_scale);
  ASSERT_TRUE(filmed.at(scene).ground);
  EXPECT_EQ(filmed.at(scene).ground->y, 1.0);
}

TEST(FrameRange, KnowsThePartBeforeAFrame) {
  const player::FrameRange range{10, 14};
  EXPECT_EQ(range.part_before(10), 0.0);
  EXPECT_EQ(range.part_before(13), 0.75);
}

TEST(StageSequence, TurnsTheSceneAtTheSameSizeAndPlace) {
  const optics::OpticalModel model(test::make_rig({}));
  render::SceneDescription scene;
  scene.materials = {render::Material{}};
  scene.spheres = {{.centre = {0, 0, 0}, .radius = 1}, {.centre = {4, 1, 0}, .radius = 1}};
  const StageSequence stages(scene, render::canvas_of(model), {.turn_degrees = 10.0}, 360.0);
  EXPECT_FALSE(stages.still());
  for (const double progress : {0.0, 0.25, 0.6}) {
    const render::Stage stage = stages.at(scene, progress);
    EXPECT_EQ(stage.mm_per_unit, stages.reference().mm_per_unit);
    EXPECT_EQ(stage.depth_scale, stages.reference().depth_scale);
    EXPECT_EQ(stage.world_from_panel.origin, stages.reference().world_from_panel.origin);
    const render::StageOptions same{.centre = stage.world_from_panel.origin,
                                    .mm_per_unit = stage.mm_per_unit,
                                    .depth_scale = stage.depth_scale,
                                    .turn_degrees = 10.0 + 360.0 * progress};
    const render::Stage still = render::make_stage(scene, model, same);
    EXPECT_EQ(stage.panel_from_world.column_x, still.panel_from_world.column_x) << progress;
    EXPECT_EQ(stage.panel_from_world.column_z, still.panel_from_world.column_z) << progress;
  }
}

}  // namespace
}  // namespace lenticule::tools
