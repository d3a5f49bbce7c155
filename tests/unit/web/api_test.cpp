// SPDX-License-Identifier: Apache-2.0
// Tests the parts of the API that need no player.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <fstream>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/api/photo_calibration.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/api/play_list.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/player_state.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

TEST(WebListToml, WritesTheKeysOfAListAndNothingElse) {
  const std::string toml = PlayList::list_toml(
      {{"loop", "forever"},
       {"default", {{"source", "card"}}},
       {"items",
        {{{"source", "/m/a.lts"}, {"loops", 2}, {"fps", "24"}},
         {{"source", "/m/b.png"},
          {"duration_s", 12.5},
          {"grid", "8x6"},
          {"invert", true},
          {"schedule", {{"days", {"mon"}}, {"from", "08:30"}, {"to", "18:00"}}}}}}});
  EXPECT_EQ(toml,
            "# Written by lenticule-web.\nformat = 1\nloop = \"forever\"\n\n[default]\n"
            "source = \"card\"\n\n[[item]]\nsource = \"/m/a.lts\"\nloops = 2\nfps = \"24\"\n\n"
            "[[item]]\nsource = \"/m/b.png\"\nduration_s = 12.5\ngrid = \"8x6\"\ninvert = true\n"
            "[item.schedule]\n"
            "days = [\"mon\"]\nfrom = \"08:30\"\nto = \"18:00\"\n");
}

TEST(WebListToml, OverlaysAreKept) {
  const std::string toml = PlayList::list_toml(
      {{"overlay", {{{"picture", "/m/logo.png"}, {"at", "bottom right"}, {"height", 0.08}}}},
       {"items",
        {{{"source", "/m/a.lts"},
          {"overlay", {{{"text", "Room \"2\""}, {"from_s", 5}}, {{"clock", "%H:%M"}}}}}}}});
  EXPECT_EQ(toml,
            "# Written by lenticule-web.\nformat = 1\n"
            "overlay = [{picture = \"/m/logo.png\", at = \"bottom right\", height = 0.08}]\n\n"
            "[[item]]\nsource = \"/m/a.lts\"\n"
            "overlay = [{text = \"Room \\\"2\\\"\", from_s = 5}, {clock = \"%H:%M\"}]\n");
}

TEST(WebListToml, TheSoundOfTheListIsKept) {
  EXPECT_EQ(PlayList::list_toml({{"sound", "/m/music.flac"},
                                 {"sound_volume", -9.5},
                                 {"items", {{{"source", "/m/a.lts"}}}}}),
            "# Written by lenticule-web.\nformat = 1\n"
            "sound = \"/m/music.flac\"\nsound_volume = -9.5\n\n"
            "[[item]]\nsource = \"/m/a.lts\"\n");
  EXPECT_EQ(PlayList::list_toml({{"sound", nullptr}, {"items", {{{"source", "/m/a.lts"}}}}}),
            "# Written by lenticule-web.\nformat = 1\n\n[[item]]\nsource = \"/m/a.lts\"\n");
}

TEST(WebListToml, ATextCannotAddKeys) {
  const std::string toml = PlayList::list_toml(
      {{"items", {{{"source", "a\"\nloops = \"forever\"\n[[item]]\nsource = \"\\"}}}}});
  EXPECT_EQ(toml.find("\nloops"), std::string::npos) << toml;
  EXPECT_NE(toml.find("source = \"a\\\"\\nloops = \\\"forever\\\"\\n[[item]]\\n"
                      "source = \\\"\\\\\"\n"),
            std::string::npos)
      << toml;
}

TEST(WebListToml, UnknownKeysAndWrongTypesAreRefused) {
  for (const char* wrong : {"[]",
                            "{}",
                            R"({"items": []})",
                            R"({"items": [1]})",
                            R"({"items": [{}]})",
                            R"({"items": [{"source": 1}]})",
                            R"({"items": [{"source": "a", "rig": "b"}]})",
                            R"({"items": [{"source": "a", "loops": [1]}]})",
                            R"({"rig": 1, "items": [{"source": "a"}]})",
                            R"({"items": [{"source": "a", "schedule": {"days": "mon"}}]})",
                            R"({"items": [{"source": "a", "invert": "yes"}]})",
                            R"({"shuffle": "yes", "items": [{"source": "a"}]})",
                            R"({"transition": 1, "items": [{"source": "a"}]})",
                            R"({"sound": 1, "items": [{"source": "a"}]})",
                            R"({"sound_volume": "1", "items": [{"source": "a"}]})",
                            R"({"items": [{"source": "a", "transition_seconds": "1"}]})",
                            R"({"items": [{"source": "a", "schedule": {"x": "y"}}]})",
                            R"({"overlay": {"text": "a"}, "items": [{"source": "a"}]})",
                            R"({"overlay": [{"text": [1]}], "items": [{"source": "a"}]})",
                            R"({"overlay": [{"t = 1, u": "a"}], "items": [{"source": "a"}]})",
                            R"({"items": [{"source": "a", "overlay": ["a"]}]})"})
    EXPECT_THROW((void)PlayList::list_toml(ordered_json::parse(wrong)), HttpError) << wrong;
  ordered_json many = {{"items", ordered_json::array()}};
  for (int k = 0; k < 1001; ++k) many["items"].push_back({{"source", "a"}});
  EXPECT_THROW((void)PlayList::list_toml(many), HttpError);
}

ordered_json counts(uint64_t vblanks, uint64_t missed, uint64_t late) {
  return {{"vblanks", vblanks}, {"missed_vblanks", missed}, {"repeated_underrun", late}};
}

TEST(WebHourHistory, AddsUpMinutesAndForgetsAfterAnHour) {
  HourHistory history;
  history.add(100, counts(5000, 7, 3));
  EXPECT_EQ(history.minutes().back().missed_vblanks, 0u) << "missed before this history";
  history.add(100, counts(5600, 8, 3));
  history.add(101, counts(9200, 8, 5));
  ASSERT_EQ(history.minutes().size(), 2u);
  EXPECT_EQ(history.minutes()[0].vblanks, 600u);
  EXPECT_EQ(history.minutes()[0].missed_vblanks, 1u);
  EXPECT_EQ(history.minutes()[1].late_frames, 2u);
  history.add(102, counts(60, 1, 0));
  EXPECT_EQ(history.minutes().back().missed_vblanks, 1u) << "a new player counts from 0";
  for (int64_t minute = 103; minute < 103 + 24 * 60; ++minute)
    history.add(minute, counts(60, 1, 0));
  EXPECT_EQ(history.minutes().size(), HourHistory::kMinutes);
}

TEST(WebTrimHistory, KeepsNamesAndSurvivesARestart) {
  const test::ScratchFolder folder;
  {
    TrimHistory history(folder / "trims.json");
    history.add({.time = 0, .who = "before"});
    history.add({.time = 1, .who = "a", .offset_lenses = 0.1});
    history.name_newest({.time = 2, .who = "a", .offset_lenses = 0.1}, "noon");
    for (int k = 0; k < 300; ++k)
      history.add({.time = 100 + k * 60, .who = "a", .offset_lenses = 0.001 * k});
  }
  TrimHistory history(folder / "trims.json");
  const ordered_json entries = history.to_json();
  EXPECT_EQ(entries.size(), 200u);
  EXPECT_EQ(entries.back()["name"], "noon") << "kept longest";
  EXPECT_TRUE(history.find(entries[0]["number"].get<uint64_t>()));
  const auto before = history.undo();
  ASSERT_TRUE(before);
  EXPECT_NEAR(before->offset_lenses, 0.298, 1e-9);
}

TEST(WebTrimHistory, PressesInARowAreOneEntryAndADamagedFileIsEmpty) {
  const test::ScratchFolder folder;
  std::ofstream(folder / "trims.json") << "{\"entries\": [{}]}";
  TrimHistory history(folder / "trims.json");
  EXPECT_TRUE(history.to_json().empty());
  EXPECT_FALSE(history.undo());
  history.add({.time = 0, .who = "before"});
  for (int k = 1; k <= 5; ++k)
    history.add({.time = 100 + k, .who = "a", .offset_lenses = 0.01 * k});
  EXPECT_EQ(history.to_json().size(), 2u);
  history.add({.time = 106, .who = "b", .offset_lenses = 0.2});
  EXPECT_EQ(history.to_json().size(), 3u) << "another sender";
}

/// Returns the answer to `frame` and the memory of a frame of 4 x 2 pixels.
std::pair<ordered_json, UniqueFd> shared_frame() {
  UniqueFd fd(::memfd_create("shared-frame", MFD_CLOEXEC));
  std::string content(64, '\0');
  content[0] = 9;
  for (int k = 0; k < 24; ++k) content += static_cast<char>(10 * (k / 3));
  content += "rig";
  EXPECT_EQ(::pwrite(fd.get(), content.data(), content.size(), 0),
            static_cast<ssize_t>(content.size()));
  ordered_json answer = {{"serial", 9u},     {"width", 4u},   {"height", 2u},    {"row_bytes", 12u},
                         {"pixels_at", 64u}, {"rig_at", 88u}, {"rig_bytes", 3u}, {"frame", 5u}};
  return {std::move(answer), std::move(fd)};
}

TEST(WebPictures, CopiesASharedFrameAndReducesIt) {
  const auto [answer, fd] = shared_frame();
  const SharedFrame frame = PictureMaker::copy_shared_frame(answer, fd.get());
  EXPECT_EQ(frame.rig_toml, "rig");
  EXPECT_EQ(frame.pixels[3], 10);
  const optics::RgbPicture half = PictureMaker::reduced(frame, 2);
  EXPECT_EQ(half.width, 2);
  EXPECT_EQ(half.height, 1);
  EXPECT_EQ(half.pixels[0], (0 + 10 + 40 + 50) / 4);
  EXPECT_EQ(half.pixels[3], (20 + 30 + 60 + 70) / 4);
  EXPECT_EQ(PictureMaker::reduced(frame, 9).width, 4);
  EXPECT_EQ(PictureMaker::jpeg_of(half, 80).substr(0, 2), "\xff\xd8");
}

TEST(WebPictures, AMemoryThatIsNotAsStatedIsRefused) {
  const auto [answer, fd] = shared_frame();
  for (const auto& [key, value] : {std::pair<const char*, ordered_json>("serial", 8u),
                                   {"width", 40000u},
                                   {"width", 0u},
                                   {"row_bytes", 11u},
                                   {"row_bytes", 60000u},
                                   {"pixels_at", UINT64_MAX},
                                   {"rig_at", 100u},
                                   {"rig_bytes", UINT64_MAX - 50},
                                   {"height", -2},
                                   {"height", "2"},
                                   {"frame", nullptr}}) {
    ordered_json wrong = answer;
    wrong[key] = value;
    EXPECT_THROW((void)PictureMaker::copy_shared_frame(wrong, fd.get()), Error) << key << value;
  }
}

TEST(WebMachine, ReadsTemperaturesAndClocksOfTheKernel) {
  const test::ScratchFolder sys;
  std::filesystem::create_directories(sys / "class/thermal/thermal_zone0");
  std::filesystem::create_directories(sys / "class/thermal/thermal_zone1");
  std::filesystem::create_directories(sys / "devices/system/cpu/cpufreq/policy0");
  std::ofstream(sys / "class/thermal/thermal_zone0/temp") << "45500\n";
  std::ofstream(sys / "class/thermal/thermal_zone0/type") << "x86_pkg_temp\n";
  std::ofstream(sys / "class/thermal/thermal_zone1/temp") << "no number\n";
  std::ofstream(sys / "devices/system/cpu/cpufreq/policy0/scaling_cur_freq") << "2400000\n";
  const ordered_json machine = machine_json(sys.path());
  ASSERT_EQ(machine["temperatures"].size(), 1u);
  EXPECT_EQ(machine["temperatures"][0]["celsius"], 45.5);
  EXPECT_EQ(machine["temperatures"][0]["name"], "x86_pkg_temp");
  EXPECT_EQ(machine["clocks"][0]["mhz"], 2400.0);
  EXPECT_TRUE(machine_json("/nowhere")["clocks"].empty());
}

TEST(WebCalibration, SeparatesTheReportFromTheMessages) {
  const CalibrationOutput both = parse_calibration_output(
      "reading\rread \x1b[1mall\nnote\n{\n \"verdict\": \"effective\"\n}\n");
  EXPECT_EQ(both.report["verdict"], "effective");
  EXPECT_EQ(both.message, "read \\x1b[1mall\nnote");
  const CalibrationOutput report = parse_calibration_output("{\n}\n");
  EXPECT_TRUE(report.report.is_object());
  EXPECT_EQ(report.message, "");
  for (const char* broken : {"", "{", "lenticule: no rig", "text\n{\n \"verdict\": "}) {
    const CalibrationOutput parsed = parse_calibration_output(broken);
    EXPECT_TRUE(parsed.report.is_null()) << broken;
  }
  EXPECT_EQ(parse_calibration_output("lenticule: no rig\n  make one\n").message,
            "lenticule: no rig\n  make one");
  EXPECT_LT(parse_calibration_output(std::string(1'000'000, 'x')).message.size(), 500u);
}

}  // namespace
}  // namespace lenticule::web
