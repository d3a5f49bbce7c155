// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule scene`: the list, and a scene with its camera path as files for this and other
// programs.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "frames/image_io.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

using ::testing::HasSubstr;

class SceneCommand : public CommandTest {
 protected:
  [[nodiscard]] std::string text_of(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(path(name)).rdbuf();
    return text.str();
  }
  [[nodiscard]] ProcessResult render(const std::string& scene, const std::string& output,
                                     std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {
        "render", scene, "--rig", source_file("scenes/rigs/tiny.toml"), "-o", path(output)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
};

TEST_F(SceneCommand, ListsThePrimitivesOfEachScene) {
  const auto list = nlohmann::json::parse(run({"scene", "list", "--json"}).out);
  std::map<std::string, nlohmann::json> scenes;
  for (const auto& scene : list) scenes[scene["name"]] = scene;
  for (const char* name : {"teapot", "room", "small-balls", "primitives", "tree", "gears", "balls",
                           "rings", "mount", "tetra", "lattice"}) {
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
  const ProcessResult done = run({"scene", "tree", "--size", "2", "-o", path("tree.nff"),
                                  "--camera", path("tree.camera"), "--json"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto json = nlohmann::json::parse(done.out);
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
  const std::string path_text = text_of("room.camera");
  EXPECT_EQ(std::count(path_text.begin(), path_text.end(), '\n'), 634 + 1);
}

TEST_F(SceneCommand, WarnsThatNffLosesTextures) {
  const ProcessResult room = run({"scene", "room", "-o", path("room.nff"), "--json"});
  EXPECT_EQ(room.exit_code, 0);
  EXPECT_THAT(room.err, HasSubstr("NFF has no textures"));
  EXPECT_EQ(nlohmann::json::parse(room.out)["notes"].size(), 1U);
  EXPECT_THAT(text_of("room.nff"), HasSubstr("# NFF has no pictures"));
  const ProcessResult tree = run({"scene", "tree", "-o", path("tree.nff")});
  EXPECT_EQ(tree.err, "");
}

TEST_F(SceneCommand, WritesMeshesAsGltfAndRefusesSpheres) {
  const ProcessResult gears =
      run({"scene", "gears", "--size", "1", "-o", path("gears.gltf"), "--json"});
  ASSERT_EQ(gears.exit_code, 0) << gears.err;
  EXPECT_EQ(render(path("gears.gltf"), "gears.png").exit_code, 0);
  const ProcessResult balls = run({"scene", "balls", "-o", path("balls.gltf")});
  EXPECT_EQ(balls.exit_code, 2);
  EXPECT_THAT(balls.err, HasSubstr("7381 spheres and 0 cones"));
  const ProcessResult other = run({"scene", "balls", "-o", path("balls.obj")});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr(".nff or .gltf"));
  EXPECT_EQ(listing(), (std::vector<std::string>{"gears.gltf", "gears.png"}));
}

}  // namespace
}  // namespace lenticule::test
