// SPDX-License-Identifier: Apache-2.0
// Frames that commands render, weave and play have the bytes that are committed in hashes/.
//
// Our kernels give the same bits with every instruction set. Embree's do not (they may contract
// a*b+c), so its kernels for SSE2 are selected here. Another version of Embree may still require
// new values.
#include "tests/commands/program.h"
#include "tests/golden/frames/golden_hashes.h"

namespace lenticule::test {
namespace {

using Words = std::vector<std::string>;

class FramesStayEqual : public CommandTest {
 protected:
  [[nodiscard]] static std::string rig(const std::string& name) {
    return source_file("scenes/rigs/" + name + ".toml");
  }

  void run_well(Words arguments) {
    Words words = program(std::move(arguments));
    words.insert(words.begin(), {"/usr/bin/env", "LENTICULE_EMBREE_ISA=sse2"});
    const ProcessResult done = run_process(words);
    ASSERT_EQ(done.exit_code, 0) << fmt::format("{}", fmt::join(words, " ")) << ": " << done.err;
  }

  /// Renders `count` frames from `first` on.
  void render(const std::string& name, const std::string& scene, Words more, int first = 0,
              int count = 2) {
    Words arguments = {"render",
                       scene,
                       "--overwrite",
                       "-o",
                       path("frame_%d.ppm"),
                       "--frames",
                       fmt::format("{}:{}", first, first + count)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    run_well(arguments);
    const std::string panel = more.at(0) == "--wall" ? "-" + more.at(3) : "";
    for (int frame = first; frame < first + count; ++frame)
      hashes_[fmt::format("{} {}", name, frame)] =
          hash_of_file(path(fmt::format("frame_{}{}.ppm", frame, panel)));
  }

  Hashes hashes_;
};

/// The frames of these scenes differ from each other.
TEST_F(FramesStayEqual, OfEveryMethod) {
  for (const char* method : {"full", "adaptive", "lens-view", "interpolate", "temporal", "hybrid"})
    for (const char* scene : {"tree:1", "gears:1", "room", "demo"})
      render(fmt::format("{} {}", scene, method), fmt::format("builtin:{}", scene),
             {"--rig", rig("paper-64"), "--method", method}, 40);
  expect_committed("methods", hashes_);
}

TEST_F(FramesStayEqual, OfEveryFeatureOfGltf) {
  const std::string models = path("models");
  ASSERT_EQ(run_process({JUDGE_MODELS, models}).exit_code, 0);
  for (const auto& model : std::filesystem::directory_iterator(models))
    for (const char* method : {"full", "adaptive"})
      render(model.path().stem().string() + " " + method, model.path().string(),
             {"--rig", rig("paper-64"), "--method", method}, 0, 1);
  expect_committed("gltf", hashes_);
}

TEST_F(FramesStayEqual, OfEveryOptionAndRig) {
  for (const Words& option :
       {Words{"--soft-shadows", "4"}, Words{"--occlusion", "8"}, Words{"--samples", "4"},
        Words{"--prefilter", "beam"}, Words{"--prefilter", "exhaustive"}, Words{"--max-depth", "1"},
        Words{"--method", "adaptive", "--error", "8"},
        Words{"--method", "adaptive", "--psnr", "40"}}) {
    Words words = {"--rig", rig("paper-64")};
    words.insert(words.end(), option.begin(), option.end());
    render(fmt::format("{}", fmt::join(option, " ")), "builtin:room", words, 40, 1);
  }
  for (const char* name : {"tiny", "portrait", "kiosk-27-1080"})
    for (const char* method : {"full", "adaptive"})
      render(fmt::format("{} {}", name, method), "builtin:balls:1",
             {"--rig", rig(name), "--method", method}, 40, 1);
  expect_committed("options", hashes_);
}

TEST_F(FramesStayEqual, OfEveryPanelOfAWall) {
  std::string wall = "format = 1\nviewer_mm = [0, 0, 500]\n";
  for (const auto& [name, side] : {std::pair{"left", -1}, std::pair{"right", 1}})
    wall += fmt::format(
        "[[panel]]\nname = \"{}\"\nrig = \"{}\"\ncentre_mm = [{}, 0, 0]\nturn_degrees = {}\n", name,
        rig("tiny"), side * 12.5, side * -3);
  write("wall.toml", wall);
  for (const char* method : {"full", "adaptive"})
    for (const char* panel : {"left", "right"})
      render(fmt::format("{} {}", panel, method), "builtin:tree:1",
             {"--wall", path("wall.toml"), "--panel", panel, "--fit", "--method", method}, 40, 1);
  expect_committed("walls", hashes_);
}

TEST_F(FramesStayEqual, WovenAndPlayed) {
  render("tree", "builtin:tree:1", {"--rig", rig("tiny"), "--method", "full"}, 40, 3);
  hashes_.clear();
  const std::string picture = path("frame_40.ppm");
  for (const char* filter : {"nearest", "linear", "gauss"}) {
    run_well({"weave", picture, "--grid", "4x2", "--filter", filter, "--rig", rig("tiny"), "-o",
              path("woven.ppm")});
    hashes_[fmt::format("weave {}", filter)] = hash_of_file(path("woven.ppm"));
  }
  run_well({"play", path("frame_%d.ppm"), "--frames", "40:43", "--rig", rig("tiny"), "--fps", "30",
            "--display", "virtual", "--clock", "simulated", "--loop", "2", "--record",
            "checksums:" + path("shown.txt")});
  hashes_["play"] = hash_of_file(path("shown.txt"));
  run_well({"convert", path("frame_%d.ppm"), "--rig", rig("tiny"), "-o", path("film.lts")});
  run_well({"convert", path("film.lts"), "-o", path("back_%d.ppm")});
  for (int frame = 0; frame < 3; ++frame)
    EXPECT_EQ(hash_of_file(path(fmt::format("back_{}.ppm", frame))),
              hash_of_file(path(fmt::format("frame_{}.ppm", 40 + frame))));
  expect_committed("commands", hashes_);
}

}  // namespace
}  // namespace lenticule::test
