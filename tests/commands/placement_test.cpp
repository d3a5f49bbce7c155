// SPDX-License-Identifier: Apache-2.0
// Tests how `lenticule render` places a file of which nothing is stated but its name.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

using frames::read_woven;

/// The code of the studio's light grey background.
constexpr uint8_t kBackground = 231;

/// A plate that is turned to the left, without camera and light.
constexpr const char* kPlate = R"(v -1 -1 0.7
v 1 -1 -0.7
v 1 1 -0.7
v -1 1 0.7
f 1 2 3 4
)";

class Placement : public CommandTest {
 protected:
  void SetUp() override { write("plate.obj", kPlate); }

  [[nodiscard]] nlohmann::json render(const std::string& output,
                                      std::vector<std::string> more = {}) const {
    return results_of(
        run(joined({"render", path("plate.obj"), "--rig", source_file("scenes/rigs/tiny.toml"),
                    "-o", path(output), "--json"},
                   more)));
  }

  /// Returns the code in the middle of a frame.
  [[nodiscard]] int middle_code(const std::string& file) const {
    const frames::WovenFrame frame = read_woven(path(file));
    return frame.row(frame.height() / 2)[3 * (frame.width() / 2) + 1];
  }
};

TEST_F(Placement, AModelStandsInThePanelPlaneAndWithinTheDepthOfField) {
  const auto stage = render("plate.png").at("stage");
  EXPECT_LE(stage.at("near_mm"), stage.at("depth_of_field_mm").get<double>() * (1 + 1e-9));
  EXPECT_NEAR(stage.at("near_mm").get<double>(), -stage.at("far_mm").get<double>(), 1e-9);
  const frames::WovenFrame frame = read_woven(path("plate.png"));
  const auto bytes = frame.bytes();
  const auto around = std::count(bytes.begin(), bytes.end(), kBackground);
  EXPECT_GT(around, 0) << "there is room around it";
  EXPECT_LT(around, static_cast<ptrdiff_t>(bytes.size()) * 3 / 4) << "it fills the panel's height";
}

TEST_F(Placement, TheShadowOnTheGroundCanBeLeftOut) {
  write("plate.obj", "v -1 0 1\nv 1 0 1\nv 1 1 -1\nv -1 1 -1\nf 1 2 3 4\n");  // hides the sky
  (void)render("with.png", {"--method", "full"});
  (void)render("without.png", {"--method", "full", "--no-ground-shadow"});
  const frames::WovenFrame with = read_woven(path("with.png"));
  const frames::WovenFrame without = read_woven(path("without.png"));
  ASSERT_EQ(with.bytes().size(), without.bytes().size());
  ptrdiff_t darker = 0;
  for (size_t n = 0; n < with.bytes().size(); ++n) {
    if (with.bytes()[n] == without.bytes()[n]) continue;
    EXPECT_LT(with.bytes()[n], without.bytes()[n]) << n;
    EXPECT_EQ(without.bytes()[n], kBackground) << "the shadow darkens the background alone: " << n;
    ++darker;
  }
  EXPECT_GT(darker, 100);
}

TEST_F(Placement, APointHasTheSameCodeAtEveryDepthBudget) {
  std::vector<int> codes;
  std::vector<double> scales;
  for (const char* budget : {"0.001", "0.01", "1", "20"}) {
    const std::string file = std::string("plate-") + budget + ".png";
    scales.push_back(render(file, {"--depth-budget", budget}).at("stage").at("depth_scale"));
    codes.push_back(middle_code(file));
  }
  EXPECT_LT(scales.front(), 0.1 * scales.back());
  EXPECT_GT(codes.front(), 40);
  EXPECT_EQ(codes, std::vector<int>(codes.size(), codes.front()));
}

TEST_F(Placement, ASequenceTurnsOnceRound) {
  const std::vector<std::string> place = {"--mm-per-unit", "2",     "--depth-scale", "0.5",
                                          "--centre",      "0,0,0", "--pitch",       "20"};
  (void)render("turn-%d.ppm", joined({"--turn", "10:370", "--frames", "0:4"}, place));
  (void)render("still.ppm", joined({"--turn", "10"}, place));
  (void)render("quarter.ppm", joined({"--turn", "100"}, place));
  EXPECT_EQ(read_woven(path("turn-0.ppm")), read_woven(path("still.ppm")));
  EXPECT_EQ(read_woven(path("turn-1.ppm")), read_woven(path("quarter.ppm")));
  EXPECT_FALSE(read_woven(path("turn-0.ppm")) == read_woven(path("turn-1.ppm")));
}

TEST_F(Placement, ATurningSceneFitsInEveryFrame) {
  const auto whole = render("turn-%d.ppm", {"--turn", "0:360", "--frames", "0:8"}).at("stage");
  for (int frame = 0; frame < 8; ++frame) {
    const frames::WovenFrame picture = read_woven(path("turn-" + std::to_string(frame) + ".ppm"));
    for (int i = 0; i < 3 * picture.width(); ++i) {
      EXPECT_EQ(picture.row(0)[i], kBackground) << frame;
      EXPECT_EQ(picture.row(picture.height() - 1)[i], kBackground) << frame;
    }
  }
  EXPECT_LE(whole.at("near_mm"), whole.at("depth_of_field_mm").get<double>() * (1 + 1e-9));
}

TEST_F(Placement, OfAModelOnAFloorSaysWhatBecameOfItsDepth) {
  write("floor.obj",
        "v -20 0 20\nv 20 0 20\nv 20 0 -20\nv -20 0 -20\nf 1 2 3 4\n"
        "v -1 0 0\nv 1 0 0\nv 1 2 -1\nv -1 2 -1\nf 5 6 7 8\n");
  const ProcessResult result =
      run({"render", path("floor.obj"), "--rig", source_file("scenes/rigs/kiosk-27-1080.toml"),
           "-o", path("floor.png"), "--json"});
  const auto stage = results_of(result).at("stage");
  const double sharp = stage.at("depth_of_field_mm");
  EXPECT_LE(stage.at("subject_near_mm"), sharp * (1 + 1e-9));
  EXPECT_GT(stage.at("near_mm"), 3.0 * sharp);
  EXPECT_NE(result.err.find("the depth is fitted to what reaches"), std::string::npos)
      << result.err;
  EXPECT_TRUE(render("plate.png").at("stage").at("subject_near_mm").is_null());
}

TEST_F(Placement, OfASurfaceThatFacesAwayShowsItsOtherSideAndSaysSo) {
  write("away.gltf",
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
 "nodes":[{"mesh":0,"rotation":[0,1,0,0]}],
 "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
 "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],
  "max":[1,1,0]}],
 "bufferViews":[{"buffer":0,"byteLength":36}],
 "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})");
  const ProcessResult result =
      run({"render", path("away.gltf"), "--rig", source_file("scenes/rigs/tiny.toml"),
           "--background", "0,0,0", "-o", path("away.png")});
  expect_end(result, 0, std::string("both sides are shown"));
  const frames::WovenFrame frame = read_woven(path("away.png"));
  EXPECT_GT(std::ranges::count_if(frame.bytes(), [](uint8_t code) { return code > 40; }), 100);
}

TEST_F(Placement, ABrightModelHasADarkBackground) {
  write("white.mtl", "newmtl white\nKd 0.95 0.95 0.95\n");
  write("plate.obj", std::string("mtllib white.mtl\nusemtl white\n") + kPlate);
  const ProcessResult result = run({"render", path("plate.obj"), "--rig",
                                    source_file("scenes/rigs/tiny.toml"), "-o", path("white.png")});
  expect_end(result, 0, std::string("dark grey"));
  const frames::WovenFrame frame = read_woven(path("white.png"));
  EXPECT_LT(frame.row(0)[0], 110);
  EXPECT_GT(middle_code("white.png"), 180);
}

}  // namespace
}  // namespace lenticule::test
