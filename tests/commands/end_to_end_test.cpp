// SPDX-License-Identifier: Apache-2.0
// Tests the end-to-end path: a scene file becomes woven frames, a ring passes them to a player, the
// display shows the rendered bytes unchanged, and an eye sees the right depth order.
#include <csignal>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/rig_text.h"

namespace lenticule::test {
namespace {

using frames::read_woven;
using frames::WovenFrame;

/// A red ball in front of the panel, left of a green one on it, left of a blue one behind it.
constexpr const char* kThreeBalls = R"(b 0 0 0
v
from 0 0 10
at 0 0 0
up 0 1 0
angle 40
hither 0.1
resolution 64 64
l 0 5 20
f 1 0 0 1 0 1 0 1
s -3 0 2 0.8
f 0 1 0 1 0 1 0 1
s 0 0 0 0.8
f 0 0 1 1 0 1 0 1
s 3 0 -2 0.8
)";

class EndToEnd : public CommandTest {
 protected:
  void SetUp() override {
    write("rig.toml",
          rig_toml({.width_px = 240,
                    .height_px = 120,
                    .pitch_subpx = 8.3,
                    .slant = 0.17,
                    .offset_lenses = 0.25,
                    .more_of_sheet = "refraction_shape = 0.45\nspot_sigma_lenses = 0.03\n"}));
    write("scene.nff", kThreeBalls);
  }

  [[nodiscard]] WovenFrame eye_picture(double x_mm) const {
    const std::string file = path("eye.png");
    expect_end(run({"eye", path("frame.png"), "--rig", path("rig.toml"), "--eye",
                    std::to_string(x_mm) + ",0,500", "--size", "240x120", "-o", file}),
               0);
    return read_woven(file);
  }
};

/// Returns the mean column of the pixels in which `channel` dominates.
double centre_column(const WovenFrame& picture, size_t channel) {
  double sum = 0.0;
  double weight = 0.0;
  for (int j = 0; j < picture.height(); ++j)
    for (int i = 0; i < picture.width(); ++i) {
      const uint8_t* p = picture.row(j) + 3 * i;
      const int others = std::max(p[(channel + 1) % 3], p[(channel + 2) % 3]);
      if (p[channel] < 40 || p[channel] < 2 * others) continue;
      sum += i;
      weight += 1.0;
    }
  EXPECT_GT(weight, 50.0) << "channel " << channel << " is not to be seen";
  return sum / weight;
}

TEST_F(EndToEnd, EyesSeeTheScenesDepthOrder) {
  ASSERT_EQ(run({"render", path("scene.nff"), "--rig", path("rig.toml"), "--depth-scale", "0.5",
                 "-o", path("frame.png")})
                .exit_code,
            0);
  const WovenFrame left = eye_picture(-25.0);
  const WovenFrame right = eye_picture(25.0);
  // Objects in front of the panel move against the eye, objects behind it move with the eye.
  EXPECT_LT(centre_column(right, 0), centre_column(left, 0) - 1.0);
  EXPECT_NEAR(centre_column(right, 1), centre_column(left, 1), 1.0);
  EXPECT_GT(centre_column(right, 2), centre_column(left, 2) + 1.0);
  // The picture is not mirrored.
  EXPECT_LT(centre_column(left, 0), centre_column(left, 1));
  EXPECT_LT(centre_column(left, 1), centre_column(left, 2));
}

TEST_F(EndToEnd, ThreadsDoNotChangeTheBytes) {
  for (const char* threads : {"1", "2", "5"})
    ASSERT_EQ(run({"render", path("scene.nff"), "--rig", path("rig.toml"), "--threads", threads,
                   "-o", path(std::string("t") + threads + ".png")})
                  .exit_code,
              0);
  EXPECT_EQ(read_woven(path("t1.png")), read_woven(path("t2.png")));
  EXPECT_EQ(read_woven(path("t1.png")), read_woven(path("t5.png")));
}

TEST_F(EndToEnd, FramesGoThroughTheRingUnchanged) {
  const std::string scene = "builtin:demo";
  std::filesystem::create_directories(path("files"));
  std::filesystem::create_directories(path("shown"));
  ASSERT_EQ(run({"render", scene, "--rig", path("rig.toml"), "--frames", "0:6", "-o",
                 path("files/%05d.png")})
                .exit_code,
            0);

  BackgroundProcess player(
      program({"play", "ring:" + path("ring.sock"), "--rig", path("rig.toml"), "--display",
               "virtual:240x120@60", "--fps", "30", "--slots", "8", "--prime", "6", "--record",
               "png:" + path("shown"), "--stats", path("stats.json")}));
  expect_end(run({"render", scene, "--rig", path("rig.toml"), "--frames", "0:6", "-o",
                  "ring:" + path("ring.sock")}),
             0);
  expect_end(player.wait(std::chrono::seconds(60)), 0);

  std::vector<std::filesystem::path> shown;
  for (const auto& entry : std::filesystem::directory_iterator(path("shown")))
    shown.push_back(entry.path());
  std::sort(shown.begin(), shown.end());
  ASSERT_EQ(shown.size(), 6u);
  for (size_t k = 0; k < shown.size(); ++k)
    EXPECT_EQ(read_woven(shown[k]), read_woven(frames::FilePattern(path("files/%05d.png")).path(k)))
        << "frame " << k;

  const nlohmann::json stats = nlohmann::json::parse(std::ifstream(path("stats.json")));
  EXPECT_EQ(stats.at("shown"), 6);
  EXPECT_EQ(stats.at("dropped"), 0);
}

TEST_F(EndToEnd, InterruptionKeepsWhatIsFinished) {
  std::filesystem::create_directories(path("out"));
  const ProcessResult stopped =
      run({"render", "builtin:demo", "--rig", path("rig.toml"), "--frames", "0:5000", "-o",
           path("out/%05d.png")},
          {.interrupt_signal = SIGINT, .interrupt_after = std::chrono::milliseconds(1500)});
  expect_end(stopped, 130, "repeat the command with --resume");
  EXPECT_NE(stopped.err.find("finishing this frame; Ctrl-C again stops at once"), std::string::npos)
      << stopped.err;
  const auto finished = frames::FilePattern(path("out/%05d.png")).existing();
  ASSERT_FALSE(finished.empty());
  for (const uint64_t number : finished)
    EXPECT_NO_THROW((void)read_woven(frames::FilePattern(path("out/%05d.png")).path(number)));
  EXPECT_EQ(finished.size(), static_cast<size_t>(std::distance(
                                 std::filesystem::directory_iterator(path("out")), {})));

  expect_end(
      run({"render", "builtin:demo", "--rig", path("rig.toml"), "--frames",
           "0:" + std::to_string(finished.size() + 2), "--resume", "-o", path("out/%05d.png")}),
      0);
  EXPECT_EQ(frames::FilePattern(path("out/%05d.png")).existing().size(), finished.size() + 2);
}

}  // namespace
}  // namespace lenticule::test
