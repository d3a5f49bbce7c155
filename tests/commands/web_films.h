// SPDX-License-Identifier: Apache-2.0
// Starts `lenticule web` with a folder of two films, beside a player that plays both in turn.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/commands/web_stage.h"

namespace lenticule::test {

/// Web has the films and the list; play() starts the player.
class Web : public WebTest {
 protected:
  void SetUp() override {
    WebTest::SetUp();
    write_film("film", 10);
    ASSERT_EQ(run({"convert", path("film/%03d.png"), "--rig", path("rig.toml"), "-o",
                   path("media/a.lts")})
                  .exit_code,
              0);
    std::filesystem::copy_file(path("media/a.lts"), path("media/b.lts"));
    write("media/list.toml",
          "loop = \"forever\"\n[[item]]\nsource = \"a.lts\"\nloops = 5\n"
          "[[item]]\nsource = \"b.lts\"\nloops = 5\n");
  }
  void play() { play(path("media/list.toml")); }
  void play(const std::string& source) {
    start(play_words(source, {"--slots", "12"}));
    ASSERT_TRUE(comes_true([&] { return frames_shown() > 3; }));
  }
  /// Starts the server beside the player, which plays the list unless it plays already.
  void serve(const std::vector<std::string>& more = {}) {
    if (!player_) play();
    start_web(more);
    connect();
  }
};

}  // namespace lenticule::test
