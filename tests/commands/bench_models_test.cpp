// SPDX-License-Identifier: Apache-2.0
// Tests that `lenticule bench models` renders models, runs a judge and compares the two. The judges
// are scripts that copy a picture.
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "lab/flip.h"
#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

class BenchModels : public CommandTest {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(path("models"));
    std::filesystem::copy(source_file("tests/data/textured-quad.gltf"), path("models/quad.gltf"));
    std::filesystem::copy(source_file("tests/data/crate.png"), path("models/crate.png"));
    std::filesystem::copy(source_file("tests/data/broken/truncated.glb"),
                          path("models/truncated.glb"));
  }

  /// Returns a judge that runs these commands; $1 is the file of jobs.
  [[nodiscard]] std::string judge(const std::string& script) const {
    std::ofstream(path("judge")) << "#!/bin/sh\n" << script << '\n';
    std::filesystem::permissions(path("judge"), std::filesystem::perms::owner_all);
    return path("judge");
  }

  [[nodiscard]] ProcessResult compare(std::vector<std::string> more) const {
    return run(joined({"bench", "models", path("models"), "-o", out(""), "--size", "32"}, more));
  }

  [[nodiscard]] std::string out(const std::string& name) const { return path("out/" + name); }
};

TEST_F(BenchModels, RendersWithoutAJudgeAndNamesWhatItCannotRead) {
  const auto json = results_of(compare({"--json"}));
  EXPECT_TRUE(json.at("flip_mean").is_null());
  ASSERT_EQ(json.at("models").size(), 2U);
  EXPECT_EQ(json["models"][0].at("name"), "quad");
  EXPECT_FALSE(json["models"][0].contains("ours_failure"));
  EXPECT_EQ(json["models"][1].at("name"), "truncated");
  EXPECT_NE(json["models"][1].at("ours_failure").get<std::string>().find("truncated.glb"),
            std::string::npos);
  const frames::WovenFrame picture = frames::read_woven(out("001-quad.ours.png"));
  EXPECT_EQ(picture.width(), 32);
  EXPECT_EQ(picture.height(), 32);
  EXPECT_TRUE(std::filesystem::exists(out("studio.hdr")));
  EXPECT_TRUE(std::filesystem::exists(out("sheet-1.png")));
}

TEST_F(BenchModels, ComparesEveryModelWithTheJudgesPicture) {
  frames::WovenFrame grey({.width = 64, .height = 64});
  std::ranges::fill(grey.bytes(), 128);
  frames::write_woven(grey.view(), path("grey.png"));
  const std::string program =
      judge("cp '" + path("grey.png") + "' '" + out("001-quad.judge-large.png") + "' && " +
            "echo 'no header' >'" + out("002-truncated.judge-large.png.txt") + "' && " +
            "cp \"$1\" '" + path("jobs.json") + "'");
  const ProcessResult result = compare({"--json", "--judge", program});
  ASSERT_EQ(result.exit_code, 0) << result.err;

  // The judge's camera is ours, and it frames what we cannot read.
  std::ifstream text(path("jobs.json"));
  const auto jobs = nlohmann::json::parse(text);
  ASSERT_EQ(jobs.size(), 2U);
  EXPECT_EQ(jobs[0].at("width"), 64);
  EXPECT_TRUE(jobs[0].at("camera").contains("from"));
  EXPECT_TRUE(jobs[1].at("camera").contains("toward"));

  const auto json = nlohmann::json::parse(result.out);
  const auto& models = json.at("models");
  ASSERT_EQ(models.size(), 2U);
  EXPECT_EQ(models[0].at("name"), "truncated") << "models that cannot be compared come first";
  EXPECT_EQ(models[0].at("judge_failure"), "no header");
  const auto ours = frames::read_woven(out("001-quad.ours.png"));
  const auto theirs = frames::read_woven(out("001-quad.judge.png"));
  EXPECT_EQ(theirs.width(), 32);
  EXPECT_EQ(theirs.bytes()[0], 128);
  const double flip = lab::flip_figures(lab::flip_map({ours.view(), lab::kFlipPixelsPerDegree},
                                                      {theirs.view(), lab::kFlipPixelsPerDegree}))
                          .mean;
  EXPECT_GT(flip, 0.01);
  EXPECT_NEAR(models[1].at("flip_mean").get<double>(), flip, 1e-6);
  EXPECT_NEAR(json.at("flip_mean").get<double>(), flip, 1e-6);
  EXPECT_EQ(frames::read_woven(out("001-quad.flip.png")).width(), 32);
  EXPECT_FALSE(std::filesystem::exists(out("001-quad.judge-large.png")));
}

TEST_F(BenchModels, FlipOfTwoPicturesIsACommandOfItsOwn) {
  const auto grey = [&](const char* name, uint8_t code) {
    frames::WovenFrame picture({.width = 40, .height = 30});
    std::ranges::fill(picture.bytes(), code);
    frames::write_woven(picture.view(), path(name));
    return path(name);
  };
  const std::string a = grey("a.png", 100);
  const std::string b = grey("b.png", 140);
  EXPECT_EQ(results_of(run({"bench", "flip", a, a, "--json"}))["mean"], 0.0);
  const auto flip = results_of(run({"bench", "flip", a, b, "--json", "--pixels-per-degree", "30"}));
  EXPECT_EQ(flip["pixels_per_degree"], 30.0);
  EXPECT_GT(flip["mean"].get<double>(), 0.1);
  EXPECT_NEAR(flip["percentile_99"].get<double>(), flip["mean"].get<double>(), 1e-5)
      << "flat pictures differ everywhere alike";
  EXPECT_NE(run({"bench", "flip", a, b}).out.find("FLIP: mean 0."), std::string::npos);
}

TEST_F(BenchModels, HasAFlipOfZeroForEqualPictures) {
  ASSERT_EQ(compare({"--supersample", "1"}).exit_code, 0);
  std::filesystem::rename(out("001-quad.ours.png"), path("ours.png"));
  const ProcessResult result =
      compare({"--supersample", "1", "--judge",
               judge("cp '" + path("ours.png") + "' '" + out("001-quad.judge-large.png") + "'")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("| quad | 0.0000 | 0.000 |"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("judge: no picture"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("1 of 2 models compared, mean FLIP 0.0000"), std::string::npos);
  EXPECT_NE(result.out.find("| `.gltf` | 1 | 0.0000 | 0.0000 |"), std::string::npos) << result.out;
  EXPECT_EQ(read_text(out("models.md")), result.out);
}

TEST_F(BenchModels, ReportsAJudgeThatFailsAfterTheTable) {
  const ProcessResult result =
      compare({"--judge", judge("echo 'chromium: not installed' >&2; exit 3")});
  expect_end(result, 1, "judge: chromium: not installed");
  EXPECT_NE(result.out.find("0 of 2 models compared"), std::string::npos);
}

TEST_F(BenchModels, RefusesFoldersWithoutModels) {
  std::filesystem::create_directory(path("empty"));
  expect_end(run({"bench", "models", path("empty"), "-o", out("")}), 4,
             "no model; expected .glb .gltf .obj .dae .fbx .3ds .ply .stl files");
}

}  // namespace
}  // namespace lenticule::test
