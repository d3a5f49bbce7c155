// SPDX-License-Identifier: Apache-2.0
// Starts players beside a test, sends them requests over their control sockets, and writes films
// for them.
#pragma once

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/comes_true.h"

namespace lenticule::test {

/// A timeout beyond the slowest machine's needs; a test that reaches it has failed.
inline constexpr std::chrono::seconds kPlayerTimeout{60};

class PlayerTest : public CommandTest {
 protected:
  using json = nlohmann::json;
  static constexpr frames::FrameGeometry kPanel{.width = 48, .height = 32};  // panel of tiny.toml
  static constexpr int kFilmFrames = 6;

  void SetUp() override {
    std::filesystem::copy_file(source_file("scenes/rigs/tiny.toml"), path("rig.toml"));
  }

  /// Writes a picture whose pixels all have the value `level`; replaces an existing file.
  void write_picture(const std::string& name, uint8_t level,
                     frames::FrameGeometry size = kPanel) const {
    frames::WovenFrame frame(size);
    std::fill(frame.bytes().begin(), frame.bytes().end(), level);
    const std::filesystem::path file = path(name);
    frames::write_woven(frame.view(), file);
  }
  /// Writes film/000.png ...: frame k has the value level + k.
  void write_film(const std::string& folder, uint8_t level) const {
    std::filesystem::create_directories(path(folder));
    for (int k = 0; k < kFilmFrames; ++k)
      write_picture(folder + "/00" + std::to_string(k) + ".png", static_cast<uint8_t>(level + k));
  }

  /// Returns the words of `play SOURCE` with rig, virtual display and control socket; `wrapper`
  /// begins the command.
  [[nodiscard]] std::vector<std::string> play_words(const std::string& source,
                                                    std::vector<std::string> more = {}) const {
    const std::vector<std::string> words =
        joined({LENTICULE_PROGRAM, "play", source, "--rig", path("rig.toml"), "--display",
                "virtual:48x32@60", "--control", path("c.sock")},
               more);
    return words;
  }
  void start(const std::vector<std::string>& words) {
    socket_ = path("c.sock");
    player_ = std::make_unique<BackgroundProcess>(words);
  }
  [[nodiscard]] ProcessResult ctl(std::vector<std::string> words) const {
    words.insert(words.begin(), {"ctl", "--json", "--socket", socket_});
    return run(words);
  }
  /// Returns the answer to a verb; null if the verb fails.
  [[nodiscard]] json asked(const std::vector<std::string>& words) const {
    const ProcessResult result = ctl(words);
    return result.exit_code == 0 ? json::parse(result.out) : json();
  }
  [[nodiscard]] json status() const {
    const json status = asked({"status"});
    return status.is_object() ? status : json::object();
  }
  [[nodiscard]] uint64_t frames_shown() const {
    return status().value("frames_shown", uint64_t{0});
  }
  /// Returns true once `frames` more frames are displayed.
  [[nodiscard]] bool film_continues(uint64_t frames = 30) const {
    const uint64_t before = frames_shown();
    return comes_true([&] { return frames_shown() >= before + frames; });
  }
  [[nodiscard]] bool says_about(const char* key, const std::string& text) const {
    return status().value(key, json()).dump().find(text) != std::string::npos;
  }
  /// Returns the value of every pixel of the displayed frame; -1 if the pixels differ or no frame
  /// is available.
  [[nodiscard]] int displayed_level() const {
    if (ctl({"snapshot", path("snap.png")}).exit_code != 0) return -1;
    const frames::WovenFrame snap = frames::read_woven(path("snap.png"));
    for (const uint8_t byte : snap.bytes())
      if (byte != snap.bytes()[0]) return -1;
    return snap.bytes()[0];
  }
  ProcessResult quit() {
    EXPECT_EQ(ctl({"quit"}).exit_code, 0);
    return player_->wait(kPlayerTimeout);
  }

  std::string socket_;
  std::unique_ptr<BackgroundProcess> player_;
};

}  // namespace lenticule::test
