// SPDX-License-Identifier: Apache-2.0
// Tests the example renderers of docs/examples, which implement docs/content/ring.md on their own,
// against the player: the displayed frames are those that they drew.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frames/image_io.h"
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

class RingExamples : public CommandTest {
 protected:
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
