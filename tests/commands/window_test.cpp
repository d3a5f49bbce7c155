// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule play --display window` on an X server in memory: screenshots, mouse and keys.
#include <array>

#include "tests/commands/player_stage.h"
#include "tests/support/rig_text.h"

namespace lenticule::test {
namespace {

using Colour = std::array<int, 3>;
constexpr Colour kRed{255, 0, 0}, kBlue{0, 0, 255}, kMagenta{255, 0, 255};

class WindowDisplay : public PlayerTest {
 protected:
  static constexpr int kScreenWidth = 1280, kScreenHeight = 360;  // as large as the window

  void SetUp() override {
    write_rig({});
    write_picture("view00.png", kRed);
    write_picture("view01.png", kBlue);
    expect_end(run({"weave", path("view%02d.png"), "--filter", "nearest", "--rig", path("rig.toml"),
                    "-o", path("woven.png")}),
               0);
    server_ = std::make_unique<BackgroundProcess>(std::vector<std::string>{
        "/bin/sh", "-c",
        "exec Xvfb -displayfd 1 -nolisten tcp -screen 0 " + std::to_string(kScreenWidth) + "x" +
            std::to_string(kScreenHeight) + "x24 -fbdir " + folder_.string() + " >" +
            path("number")});
    ASSERT_TRUE(comes_true([&] { return !display().empty(); })) << "is Xvfb installed?";
  }

  /// Writes a rig with two views in a viewing zone of 130 mm: each eye is in the middle of its
  /// view.
  void write_rig(const std::string& panel_line) const {
    write("rig.toml", rig_toml({.width_px = 96,
                                .height_px = 54,
                                .more_of_panel = panel_line,
                                .pitch_subpx = 12.0,
                                .gap_mm = 10.0,
                                .distance_mm = 650.0}));
  }

  void write_picture(const std::string& name, Colour colour) const {
    frames::WovenFrame frame({.width = 96, .height = 54});
    for (size_t n = 0; n < frame.bytes().size(); ++n)
      frame.bytes()[n] = static_cast<uint8_t>(colour[n % 3]);
    frames::write_woven(frame.view(), path(name));
  }

  [[nodiscard]] std::string display() const {
    std::ifstream file(path("number"));
    std::string number;
    return std::getline(file, number) && !file.eof() ? ":" + number : std::string();
  }

  void play(std::vector<std::string> more = {}) {
    start(joined({"/usr/bin/env", "DISPLAY=" + display(), "SDL_VIDEODRIVER=x11", LENTICULE_PROGRAM,
                  "play", path("woven.png"), "--rig", path("rig.toml"), "--display", "window"},
                 more));
  }
  void xdotool(std::vector<std::string> words) const {
    words.insert(words.begin(), {"/usr/bin/env", "DISPLAY=" + display(), "xdotool"});
    expect_end(run_process(words), 0);
  }

  /// Returns the colour of a pixel of the screen, from the server's file in the format XWD.
  [[nodiscard]] Colour colour_at(int x, int y) const {
    const std::string dump = read_text(path("Xvfb_screen0"));
    const auto word = [&](size_t n) {
      uint32_t value = 0;
      for (size_t k = 0; k < 4; ++k) value = value << 8 | static_cast<uint8_t>(dump.at(4 * n + k));
      return size_t{value};
    };
    constexpr size_t kBitsPerPixel = 11, kBytesPerRow = 12, kColours = 19, kColourBytes = 12;
    EXPECT_EQ(word(kBitsPerPixel), 32u);
    const size_t at = word(0) + kColourBytes * word(kColours) +
                      static_cast<size_t>(y) * word(kBytesPerRow) + 4 * static_cast<size_t>(x);
    const auto byte = [&](size_t n) { return int{static_cast<uint8_t>(dump.at(at + n))}; };
    return {byte(2), byte(1), byte(0)};
  }
  /// Returns true once both halves of the window have these colours.
  [[nodiscard]] bool shows(Colour left, Colour right) const {
    return comes_true([&] { return colour_at(400, 180) == left && colour_at(880, 180) == right; });
  }

  std::unique_ptr<BackgroundProcess> server_;
};

TEST_F(WindowDisplay, ShowsWhatTwoEyesSeeWhereTheMousePutsThem) {
  play();
  EXPECT_TRUE(shows(kRed, kBlue));
  xdotool({"mousemove", "960", "180"});  // half a zone to the right: both eyes change their view
  EXPECT_TRUE(shows(kBlue, kRed));
  xdotool({"key", "c"});
  EXPECT_TRUE(shows(kRed, kBlue));
  xdotool({"key", "a"});
  EXPECT_TRUE(shows(kMagenta, kMagenta)) << "red from the left eye, blue from the right one";
  xdotool({"key", "q"});
  expect_end(player_->wait(kPlayerTimeout), 0);
}

TEST_F(WindowDisplay, ShowsATurnedPanelAsItsViewerSeesIt) {
  write_rig("mounting = \"180\"\n");
  play();
  EXPECT_TRUE(shows(kRed, kBlue));
}

TEST_F(WindowDisplay, ClosesWithThePlayer) {
  play({"--duration", "1"});
  EXPECT_EQ(player_->wait(kPlayerTimeout).exit_code, 0);
  EXPECT_TRUE(shows({0, 0, 0}, {0, 0, 0}));
}

TEST_F(WindowDisplay, NeedsADesktop) {
  expect_end(run_process({"/usr/bin/env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY", "-u",
                          "SDL_VIDEODRIVER", LENTICULE_PROGRAM, "play", path("woven.png"), "--rig",
                          path("rig.toml"), "--display", "window"}),
             3, "desktop session");
}

TEST_F(WindowDisplay, RefusesFlagsThatAWindowCannotFollow) {
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"--clock", "simulated"},
        std::vector<std::string>{"--record", "checksums:" + path("sums.txt")}}) {
    expect_end(
        run(joined({"play", path("woven.png"), "--rig", path("rig.toml"), "--display", "window"},
                   more)),
        2, more[0]);
  }
}

}  // namespace
}  // namespace lenticule::test
