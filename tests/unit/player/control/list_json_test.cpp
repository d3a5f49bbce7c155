// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>

#include "player/control/control_answers.h"

namespace lenticule::player {
namespace {

using nlohmann::ordered_json;

TEST(ListJson, HasTheKeysOfTheFile) {
  const Playlist list = parse_playlist(R"(
loop = "forever"
shuffle = 5
transition = "fade"
sound = "music.flac"
sound_volume = -9.5
[[overlay]]
picture = "logo.png"
[default]
source = "card"
[[item]]
source = "film.lts"
loops = 2
fps = "24"
[[item]]
source = "poster.png"
[[item]]
source = "clip.mkv"
duration_s = 12.5
cut = "primed"
wait_s = 3.0
grid = "8x6"
aspect = 0.75
invert = true
fit = "cover"
sound = "clip.opus"
volume = -6
weight = 3
transition = "cross"
transition_seconds = 1.5
[[item.overlay]]
text = "Room 2"
at = "top"
height = 0.1
from_s = 5
for_s = 10
[item.schedule]
days = ["mon", "sun"]
from = "08:30"
to = "24:00"
dates = ["12-01..02-28"]
except = ["2026-12-24"]
)",
                                       "list", "/films");
  const ordered_json json = list_json(list, 0);
  EXPECT_EQ(json["file"], nullptr) << "it was not read from a file";
  EXPECT_EQ(json["loop"], "forever");
  EXPECT_EQ(json["count"], 3);
  EXPECT_EQ(json["default"]["source"], "card");
  EXPECT_EQ(json["items"][0]["source"], "/films/film.lts");
  EXPECT_EQ(json["items"][0]["loops"], 2);
  EXPECT_EQ(json["items"][0]["fps"], "24");
  EXPECT_FALSE(json["items"][1].contains("loops")) << "a picture has its usual duration";
  EXPECT_EQ(json["items"][2]["duration_s"], 12.5);
  EXPECT_EQ(json["items"][2]["cut"], "primed");
  EXPECT_EQ(json["items"][2]["wait_s"], 3.0);
  EXPECT_EQ(json["items"][2]["schedule"]["days"], (ordered_json{"mon", "sun"}));
  EXPECT_EQ(json["items"][2]["schedule"]["from"], "08:30");
  EXPECT_EQ(json["items"][2]["schedule"]["to"], "24:00");
  EXPECT_EQ(json["items"][2]["schedule"]["dates"], ordered_json::array({"12-01..02-28"}));
  EXPECT_EQ(json["items"][2]["schedule"]["except"], ordered_json::array({"2026-12-24"}));
  EXPECT_EQ(json["items"][2]["grid"], "8x6");
  EXPECT_EQ(json["items"][2]["aspect"], 0.75);
  EXPECT_EQ(json["items"][2]["invert"], true);
  EXPECT_EQ(json["items"][2]["fit"], "cover");
  EXPECT_EQ(json["items"][2]["weight"], 3);
  EXPECT_EQ(json["items"][2]["sound"], "/films/clip.opus");
  EXPECT_EQ(json["items"][2]["volume"], -6.0);
  EXPECT_EQ(json["sound"], "/films/music.flac");
  EXPECT_EQ(json["sound_volume"], -9.5);
  EXPECT_FALSE(json["items"][0].contains("sound"));
  EXPECT_EQ(json["overlay"],
            ordered_json::parse(R"([{"picture":"/films/logo.png","at":"bottom right"}])"));
  EXPECT_FALSE(json["items"][0].contains("overlay")) << "it has that of the list";
  EXPECT_EQ(json["items"][2]["overlay"],
            ordered_json::parse(
                R"([{"text":"Room 2","at":"top","height":0.1,"from_s":5.0,"for_s":10.0}])"));
  EXPECT_EQ(json["shuffle"], 5);
  EXPECT_EQ(json["transition"], "fade");
  EXPECT_EQ(json["transition_seconds"], 0.5);
  EXPECT_FALSE(json["items"][0].contains("transition")) << "it has that of the list";
  EXPECT_EQ(json["items"][2]["transition"], "cross");
  EXPECT_EQ(json["items"][2]["transition_seconds"], 1.5);
}

TEST(ListJson, ARelativeNameIsWholeForReadersInOtherFolders) {
  Playlist list =
      parse_playlist("[[item]]\nsource = \"a.lts\"\n", "films/list.toml", "shows/../films");
  list.file = FileMark{};
  const ordered_json json = list_json(list, 0);
  const auto here = std::filesystem::current_path() / "films";
  EXPECT_EQ(json["file"], (here / "list.toml").string());
  EXPECT_EQ(json["items"][0]["source"], (here / "a.lts").string());
}

TEST(ListJson, ALongListComesInPartsBelowTheLimitOfALine) {
  Playlist list;
  for (size_t k = 0; k < 100; ++k)
    list.items.push_back(
        {.source = parse_source("/" + std::string(4000, 'a') + std::to_string(k))});
  size_t seen = 0;
  for (int parts = 0; seen < list.items.size(); ++parts) {
    ASSERT_LT(parts, 20);
    const ordered_json json = list_json(list, seen);
    ASSERT_FALSE(json["items"].empty());
    EXPECT_LT(json.dump().size(), size_t{64} << 10);
    EXPECT_EQ(json["items"][0]["source"], list.items[seen].source.text);
    seen += json["items"].size();
  }
  EXPECT_TRUE(list_json(list, 5000)["items"].empty());
}

}  // namespace
}  // namespace lenticule::player
