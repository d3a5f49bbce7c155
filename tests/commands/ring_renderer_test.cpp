// SPDX-License-Identifier: Apache-2.0
// Tests the example renderers of docs/examples, which implement docs/content/ring.md on their own,
// against the player: the displayed frames are those that they drew.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weaving/fast_weaver.h"
#include "optics/model.h"
#include "optics/rig_file.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

const std::string kTiny = source_file("scenes/rigs/tiny.toml");
constexpr uint64_t kFrames = 24;  // more than slots, so that the renderer waits for some

/// Returns the frame that the examples draw.
frames::WovenFrame drawn(uint64_t number) {
  frames::WovenFrame frame({.width = 48, .height = 32});
  for (int y = 0; y < frame.height(); ++y)
    for (size_t x = 0; x < frame.geometry().row_bytes(); ++x)
      frame.row(y)[x] = static_cast<uint8_t>(x + 3 * static_cast<size_t>(y) + 7 * number);
  return frame;
}

constexpr frames::QuiltLayout kQuilt{.columns = 3, .rows = 2, .views = 5};

/// Returns the picture of views that the examples draw, of the size that the player asks for.
frames::WovenFrame drawn_views(uint64_t number) {
  frames::WovenFrame quilt({.width = 61, .height = 41});
  const int width = 61 / 3, height = 41 / 2;
  for (int view = 0; view < kQuilt.views; ++view)
    for (int y = 0; y < height; ++y) {
      uint8_t* const row = quilt.row(41 - (view / 3 + 1) * height + y) + view % 3 * width * 3;
      for (int x = 0; x < 3 * width; ++x)
        row[x] = static_cast<uint8_t>(static_cast<uint64_t>(x + 3 * y + 40 * view) + 7 * number);
    }
  return quilt;
}

class RingExamples : public CommandTest {
 protected:
  /// Plays the views of a renderer and compares the panel's frames with those of the weaver.
  void expect_woven(std::vector<std::string> renderer) const {
    const std::string socket = path("ring");
    BackgroundProcess player(program(
        {"play", "ring:" + socket + "?size=61x41", "--grid", "3x2", "--views", "5", "--rig", kTiny,
         "--display", "virtual", "--record", "png:" + path("woven"), "--json", "--wait", "60"}));
    for (int tries = 0; tries < 3000 && !std::filesystem::exists(socket); ++tries) usleep(10000);
    renderer.insert(renderer.begin() + static_cast<ptrdiff_t>(renderer.size() > 2 ? 2 : 1),
                    {socket, std::to_string(kFrames)});
    expect_end(run_process(renderer), 0);
    const ProcessResult played = player.wait(std::chrono::seconds(60));
    ASSERT_EQ(played.exit_code, 0) << played.err;
    EXPECT_EQ(nlohmann::json::parse(played.out).at("shown"), kFrames) << played.out;
    const optics::OpticalModel model(optics::load_rig(kTiny));
    uint64_t compared = 0;
    for (uint64_t number = 0; number < kFrames; ++number) {
      char name[16];
      std::snprintf(name, sizeof name, "%08ju.png", uintmax_t{number});
      const std::string file = path(std::string("woven/") + name);
      if (!std::filesystem::exists(file)) continue;
      EXPECT_EQ(frames::read_woven(file),
                frames::weave_fast(frames::ViewSet(drawn_views(number), kQuilt), model))
          << number;
      ++compared;
    }
    EXPECT_GE(compared, 2u);
  }

  static std::string fingerprint() {
    return results_of(run({"rig", "show", kTiny, "--json"})).at("fingerprint").get<std::string>();
  }

  void expect_shown(std::vector<std::string> renderer) const {
    const std::string socket = path("ring");
    BackgroundProcess player(
        program({"play", "ring:" + socket, "--rig", kTiny, "--display", "virtual", "--slots", "5",
                 "--record", "png:" + path("shown"), "--json", "--wait", "60"}));
    for (int tries = 0; tries < 3000 && !std::filesystem::exists(socket); ++tries) usleep(10000);
    renderer.insert(renderer.end(), {socket, std::to_string(kFrames), fingerprint()});
    expect_end(run_process(renderer), 0);
    const ProcessResult played = player.wait(std::chrono::seconds(60));
    ASSERT_EQ(played.exit_code, 0) << played.err;
    const auto report = nlohmann::json::parse(played.out);
    EXPECT_EQ(report.at("shown"), kFrames) << played.out;
    uint64_t compared = 0;
    for (uint64_t number = 0; number < kFrames; ++number) {
      char name[16];
      std::snprintf(name, sizeof name, "%08ju.png", uintmax_t{number});
      const std::string file = path(std::string("shown/") + name);
      if (!std::filesystem::exists(file)) continue;  // a busy machine does not record every frame
      EXPECT_EQ(frames::read_woven(file), drawn(number)) << number;
      ++compared;
    }
    EXPECT_GE(compared, 2u);
  }
};

TEST_F(RingExamples, TheCRenderersFramesAreDisplayedUnchanged) {
  expect_shown({RING_RENDERER_EXAMPLE});
}

TEST_F(RingExamples, ThePythonRenderersFramesAreDisplayedUnchanged) {
  expect_shown({"/usr/bin/python3", source_file("docs/examples/ring_renderer.py")});
}

TEST_F(RingExamples, TheViewsOfTheCApiAreWoven) { expect_woven({PUSH_VIEWS_EXAMPLE}); }

TEST_F(RingExamples, TheViewsOfThePythonRendererAreWoven) {
  expect_woven({"/usr/bin/python3", source_file("docs/examples/ring_renderer.py"), "views"});
}

TEST_F(RingExamples, TheNextRendererOfViewsContinues) {
  const std::string socket = path("ring");
  const BackgroundProcess player(program({"play", "ring:" + socket, "--depth", "right", "--rig",
                                          kTiny, "--display", "virtual", "--loop", "forever"}));
  for (int tries = 0; tries < 3000 && !std::filesystem::exists(socket); ++tries) usleep(10000);
  // More frames than slots: a renderer ends only if the player shows its frames.
  for (int renderers = 0; renderers < 3; ++renderers)
    expect_end(run_process({PUSH_VIEWS_EXAMPLE, socket, std::to_string(kFrames)}), 0);
}

TEST_F(RingExamples, ViewsAreRefusedByAPlayerOfWovenFramesAndTheReverse) {
  for (const bool views : {false, true}) {
    const std::string socket = path(views ? "views" : "woven");
    std::vector<std::string> command{"play", "ring:" + socket, "--rig",
                                     kTiny,  "--display",      "virtual"};
    if (views) command.insert(command.end(), {"--grid", "3x2"});
    const BackgroundProcess player{program(command)};
    for (int tries = 0; tries < 3000 && !std::filesystem::exists(socket); ++tries) usleep(10000);
    expect_end(run_process({"/usr/bin/python3", source_file("docs/examples/ring_renderer.py"),
                            socket, "3", views ? fingerprint() : "views"}),
               1, views ? "the player takes views" : "the player takes woven frames of 48x32");
  }
}

TEST_F(RingExamples, AreRefusedForAnotherRig) {
  const std::string socket = path("ring");
  const BackgroundProcess player(
      program({"play", "ring:" + socket, "--rig", kTiny, "--display", "virtual"}));
  for (int tries = 0; tries < 3000 && !std::filesystem::exists(socket); ++tries) usleep(10000);
  for (std::vector<std::string> renderer :
       {std::vector<std::string>{RING_RENDERER_EXAMPLE},
        {"/usr/bin/python3", source_file("docs/examples/ring_renderer.py")}}) {
    renderer.insert(renderer.end(), {socket, "3", "0123456789abcdef"});
    expect_end(run_process(renderer), 1, "the player's rig is");
  }
}

}  // namespace
}  // namespace lenticule::test
