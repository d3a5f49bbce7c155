// SPDX-License-Identifier: Apache-2.0
// Tests that after repeated failed starts the next start shows the reason instead of failing again.
#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <thread>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/rig_text.h"

namespace lenticule::test {
namespace {

class SafeStart : public CommandTest {
 protected:
  static constexpr frames::FrameGeometry kPanel{240, 180};

  void SetUp() override {
    write("rig.toml",
          rig_toml({.width_px = 240,
                    .height_px = 180,
                    .pitch_subpx = 8.3,
                    .slant = 0.17,
                    .offset_lenses = 0.25,
                    .more_of_sheet = "refraction_shape = 0.45\nspot_sigma_lenses = 0.03\n"}));
    std::filesystem::create_directories(path("run"));
  }

  [[nodiscard]] std::vector<std::string> play(std::vector<std::string> flags) const {
    const std::vector<std::string> words =
        joined({"/usr/bin/env", "RUNTIME_DIRECTORY=" + path("run"), LENTICULE_PROGRAM, "play",
                path("film.png"), "--rig", path("rig.toml"), "--display", "virtual", "--stats",
                path("stats.json")},
               flags);
    return words;
  }
  void write_film() const {
    frames::WovenFrame film(kPanel);
    std::fill(film.bytes().begin(), film.bytes().end(), uint8_t{77});
    frames::write_woven(film.view(), path("unfinished.png"));
    std::filesystem::rename(path("unfinished.png"), path("film.png"));
  }
  [[nodiscard]] nlohmann::json stats() const {
    return nlohmann::json::parse(std::ifstream(path("stats.json")));
  }
  /// Returns true if the picture is a test card: a white line along every edge.
  [[nodiscard]] bool is_card(const std::string& file) const {
    const frames::WovenFrame frame = frames::read_woven(path(file));
    return std::all_of(frame.row(0), frame.row(0) + 3 * kPanel.width,
                       [](uint8_t value) { return value == 255; });
  }
};

TEST_F(SafeStart, ShowsATestCardWithTheReasonIfTheSourceCannotBeOpened) {
  expect_end(run_process(play({"--safe", "--duration", "1", "--record", "png:" + path("shown")})),
             4, "film.png");
  EXPECT_TRUE(is_card("shown/00000000.png"));
  EXPECT_NE(stats().at("safe_start").at("problem").get<std::string>().find("film.png"),
            std::string::npos);
  EXPECT_EQ(stats().at("real_time_priority"), false);
}

TEST_F(SafeStart, PlaysTheFilmAsSoonAsItCanBeOpened) {
  BackgroundProcess player(play({"--safe", "--loop", "1", "--record", "png:" + path("shown")}));
  for (int i = 0; i < 3000 && !std::filesystem::exists(path("stats.json")); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  write_film();
  expect_end(player.wait(std::chrono::seconds(60)), 0);
  EXPECT_FALSE(is_card("shown/00000001.png")) << "the second frame of the film";
  EXPECT_TRUE(stats().at("safe_start").at("problem").is_null());
}

TEST_F(SafeStart, AnInvalidFlagIsStillAnError) {
  EXPECT_EQ(run_process(play({"--safe", "--loop", "never"})).exit_code, 2);
}

TEST_F(SafeStart, ACrashLoopShowsATestCardWithTheReason) {
  for (int start = 0; start < 5; ++start) {
    const ProcessResult played = run_process(play({}));
    EXPECT_EQ(played.exit_code, 4) << played.err;
    EXPECT_EQ(played.err.find("in safe mode"), std::string::npos);
  }
  const ProcessResult in_safe_mode =
      run_process(play({"--duration", "1", "--record", "png:" + path("shown")}));
  EXPECT_NE(in_safe_mode.err.find("5 starts failed"), std::string::npos) << in_safe_mode.err;
  EXPECT_TRUE(is_card("shown/00000000.png"));
  EXPECT_EQ(stats().at("safe_start").at("failed_starts"), 5);
}

TEST_F(SafeStart, DelaysASourceThatCrashedEveryPlayer) {
  write_film();
  std::string starts;
  timespec since_boot{};
  clock_gettime(CLOCK_BOOTTIME, &since_boot);
  for (int start = 0; start < 10; ++start) starts += std::to_string(since_boot.tv_sec) + " \n";
  write("run/starts", starts);
  const ProcessResult played =
      run_process(play({"--duration", "1", "--record", "png:" + path("shown")}));
  EXPECT_EQ(played.exit_code, 1) << played.err;
  EXPECT_TRUE(is_card("shown/00000000.png"));
  EXPECT_NE(played.err.find("ended 10 times"), std::string::npos) << played.err;
}

TEST_F(SafeStart, OrderlyEndsDoNotCountAsFailures) {
  write_film();
  for (int start = 0; start < 7; ++start) {
    expect_end(run_process(play({"--duration", "0.1"})), 0);
  }
  EXPECT_FALSE(stats().contains("safe_start"));
}

}  // namespace
}  // namespace lenticule::test
