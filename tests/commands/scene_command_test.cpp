// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule scene`: the list, and a scene with its camera path as files for this and other
// programs.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

using ::testing::HasSubstr;

class SceneCommand : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult render(const std::string& scene, const std::string& output,
                                     std::vector<std::string> more = {}) const {
    return run(
        joined({"render", scene, "--rig", source_file("scenes/rigs/tiny.toml"), "-o", path(output)},
               more));
  }
};

TEST_F(SceneCommand, ListsThePrimitivesOfEachScene) {
  const auto list = nlohmann::json::parse(run({"scene", "list", "--json"}).out);
  std::map<std::string, nlohmann::json> scenes;
  for (const auto& scene : list) scenes[scene["name"]] = scene;
  for (const char* name :
       {"teapot", "room", "small-balls", "primitives", "tree", "gears", "balls"}) {
    ASSERT_TRUE(scenes.contains(name)) << name;
    EXPECT_GT(scenes[name]["primitives"], 100) << name;
    EXPECT_GE(scenes[name]["lights"], 2) << name;
  }
  EXPECT_EQ(scenes["balls"]["spheres"], 7381);
  EXPECT_EQ(scenes["room"]["frames"], 634);
  EXPECT_EQ(scenes["room"]["wears_pictures"], true);
  EXPECT_THAT(run({"scene", "list"}).out, HasSubstr("7382 primitives, 3 lights, still"));
}

TEST_F(SceneCommand, TheSequenceIsOneFileAndItsCameraPath) {
  const auto json = results_of(run({"scene", "tree", "--size", "2", "-o", path("tree.nff"),
                                    "--camera", path("tree.camera"), "--json"}));
  EXPECT_EQ(json["frames"], 612);
  EXPECT_EQ(json["primitives"], 15);
  EXPECT_EQ(json["camera"], path("tree.camera"));
  ASSERT_EQ(render(path("tree.nff"), "by-path-%d.png",
                   {"--camera", path("tree.camera"), "--frames", "100:101"})
                .exit_code,
            0);
  ASSERT_EQ(render("builtin:tree:2", "built-in-%d.png", {"--frames", "100:101"}).exit_code, 0);
  EXPECT_EQ(frames::read_woven(path("by-path-100.png")),
            frames::read_woven(path("built-in-100.png")));
}

TEST_F(SceneCommand, ACameraPathAloneWritesNoScene) {
  const ProcessResult done = run({"scene", "room", "--camera", path("room.camera")});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(done.out, "");
  EXPECT_EQ(listing(), (std::vector<std::string>{"room.camera"}));
  const std::string path_text = read_text(path("room.camera"));
  EXPECT_EQ(std::count(path_text.begin(), path_text.end(), '\n'), 634 + 1);
}

TEST_F(SceneCommand, WarnsThatNffLosesTextures) {
  const ProcessResult room = run({"scene", "room", "-o", path("room.nff"), "--json"});
  EXPECT_EQ(room.exit_code, 0);
  EXPECT_THAT(room.err, HasSubstr("NFF has no textures"));
  EXPECT_EQ(nlohmann::json::parse(room.out)["notes"].size(), 1U);
  EXPECT_THAT(read_text(path("room.nff")), HasSubstr("# NFF has no pictures"));
  const ProcessResult tree = run({"scene", "tree", "-o", path("tree.nff")});
  EXPECT_EQ(tree.err, "");
}

TEST_F(SceneCommand, RefusesOtherFormats) {
  const ProcessResult other = run({"scene", "balls", "-o", path("balls.obj")});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("scenes are written as .nff"));
  EXPECT_TRUE(listing().empty());
}

// ---- lenticule scene show

TEST_F(SceneCommand, ShowsWhatAFileHolds) {
  const auto json =
      results_of(run({"scene", "show", source_file("tests/data/turning-box.gltf"), "--json"}));
  EXPECT_GT(json["triangles"], 10);
  EXPECT_GT(json["vertices"], json["triangles"].get<int>() / 2);
  EXPECT_EQ(json["cameras"].size(), 1U);
  EXPECT_GE(json["materials"].size(), 1U);
  EXPECT_EQ(json["up"], "+y");
  EXPECT_GT(json["duration_seconds"], 0.0);
  EXPECT_GT(json["animated_nodes"], 0);
  ASSERT_EQ(json["textures"].size(), 2U);
  for (const auto& texture : json["textures"]) EXPECT_GT(texture["width"], 0);
  for (int axis = 0; axis < 3; ++axis) EXPECT_LT(json["low"][axis], json["high"][axis]);
  EXPECT_FALSE(json["default_light"]);
}

TEST_F(SceneCommand, ShowsInWordsWhatIsLeftOut) {
  write("cloud.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\nf 1 2 3\n");
  const ProcessResult result = run({"scene", "show", path("cloud.obj")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* text : {"1 triangles", "none: a default one is added",
                           "points and lines left "
                           "out",
                           "1 x 1 x 0 units", "+y is up"})
    EXPECT_THAT(result.out, HasSubstr(text));
  EXPECT_EQ(listing(), (std::vector<std::string>{"cloud.obj"}));
}

TEST_F(SceneCommand, ShowsThatACameraLooksAway) {
  write("away.nff", "v from 0 0 5 at 0 0 9 up 0 1 0 angle 40 hither 1 resolution 9 9\ns 0 0 0 1\n");
  const ProcessResult result = run({"scene", "show", path("away.nff")});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("all of it lies outside the camera's view"));
}

TEST_F(SceneCommand, AThumbnailIsOneViewOfTheScene) {
  expect_end(run({"scene", "show", "builtin:teapot:2", "-o", path("pot.png")}), 0);
  const frames::WovenFrame picture = frames::read_woven(path("pot.png"));
  EXPECT_EQ(picture.width(), 480);
  EXPECT_EQ(picture.height(), 360);
  // Neighbours agree, which views of a lens sheet do not.
  int alike = 0;
  for (int j = 0; j < picture.height(); ++j)
    for (int i = 0; i + 1 < picture.width(); ++i)
      alike += std::abs(picture.row(j)[3 * i] - picture.row(j)[3 * i + 3]) < 8 ? 1 : 0;
  EXPECT_GT(alike, 480 * 360 * 9 / 10);
  EXPECT_NE(picture.row(180)[3 * 240], picture.row(5)[3 * 5]) << "the pot stands in the middle";
}

TEST_F(SceneCommand, ShowNamesWhatIsMissing) {
  const ProcessResult without = run({"scene", "show"});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.err, HasSubstr("scene show: SCENE is missing"));
  EXPECT_EQ(run({"scene", "show", path("none.glb")}).exit_code, 4);
  EXPECT_EQ(run({"scene", "show", "builtin:teapot", "-o", path("pot.xyz")}).exit_code, 2);
  const ProcessResult nothing = run({"scene"});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.err, HasSubstr("NAME is missing"));
}

}  // namespace
}  // namespace lenticule::test
