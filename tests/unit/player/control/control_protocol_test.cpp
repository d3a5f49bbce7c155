// SPDX-License-Identifier: Apache-2.0
// Tests valid and invalid requests.
#include "player/control/control_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "player/control/control_server.h"

namespace lenticule::player {
namespace {

using nlohmann::json;

ControlRequest parse(const std::string& line) {
  json id;
  return parse_control_request(line, id);
}

std::string complaint(const std::string& line, json* id = nullptr) {
  json ignored;
  try {
    (void)parse_control_request(line, id != nullptr ? *id : ignored);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    return error.what();
  }
  return "none";
}

TEST(ControlProtocol, AnOverlayIsCompleteOrRefused) {
  for (const auto& [line, cause] :
       {std::pair(R"({"do":"overlay"})", "nothing to show"),
        {R"({"do":"overlay","off":false})", "off: "},
        {R"({"do":"overlay","off":true,"text":"a"})", "off: "},
        {R"({"do":"overlay","text":"a","from_s":1})", "unknown field 'from_s'"},
        {R"({"do":"overlay","picture":"a.png"})", "picture: not an absolute path"},
        {R"({"do":"overlay","text":"a","for_s":-1})", "for_s: not a number above 0"}})
    EXPECT_THAT(complaint(line), testing::HasSubstr(cause)) << line;
}

TEST(ControlProtocol, EveryVerbHasItsFields) {
  EXPECT_EQ(parse(R"({"id":7,"do":"status"})").verb, "status");
  EXPECT_EQ(parse(R"({"id":7,"do":"status"})").id, 7);
  const ControlRequest load = parse(R"({"do":"load","source":"/a.toml","item":2,"frame":5})");
  EXPECT_EQ(load.source, "/a.toml");
  EXPECT_EQ(load.item, 2u);
  EXPECT_EQ(load.frame, 5u);
  EXPECT_EQ(parse(R"({"do":"seek","frame":12})").frame, 12u);
  EXPECT_EQ(parse(R"({"do":"loop","count":"forever"})").loops, 0u);
  EXPECT_EQ(parse(R"({"do":"loop","count":3})").loops, 3u);
  const ControlRequest by = parse(R"({"do":"trim","offset_by":-0.01})");
  EXPECT_TRUE(by.relative);
  EXPECT_EQ(by.offset_lenses, -0.01);
  EXPECT_FALSE(by.pitch_relative);
  EXPECT_FALSE(parse(R"({"do":"trim","pitch":1e-5})").relative);
  EXPECT_EQ(parse(R"({"do":"rig","toml":"format = 1\n"})").rig_toml, "format = 1\n");
  const ControlRequest eye = parse(R"({"do":"snapshot","file":"/s.png","eye":[1,-2,700]})");
  EXPECT_EQ(eye.eye_mm, (std::array<double, 3>{1.0, -2.0, 700.0}));
  EXPECT_EQ(parse(R"({"do":"snapshot","file":"/s.png","panel":"left"})").panel, "left");
  const ControlRequest interrupt = parse(R"({"do":"interrupt","source":"/b.lts","seconds":12.5})");
  EXPECT_EQ(interrupt.source, "/b.lts");
  EXPECT_EQ(interrupt.seconds, 12.5);
  EXPECT_TRUE(parse(R"({"do":"cue","item":3,"frame":9,"then_back":true})").then_back);
  EXPECT_EQ(parse(R"({"do":"speed","factor":0.5})").speed_permille, 500u);
  EXPECT_FALSE(parse(R"({"do":"power","to":"off"})").on);
  EXPECT_TRUE(parse(R"({"do":"power","to":"on"})").on);
  const ControlRequest overlay =
      parse(R"({"id":1,"do":"overlay","text":"Closed","at":"top","height":0.1,"for_s":30})");
  EXPECT_EQ(overlay.overlay, (OverlaySpec{.kind = OverlaySpec::Kind::Text,
                                          .content = "Closed",
                                          .place = 1,
                                          .height = 0.1,
                                          .for_s = 30.0}));
  EXPECT_EQ(parse(R"({"do":"overlay","off":true})").overlay, std::nullopt);
  EXPECT_EQ(parse(R"({"do":"overlay","picture":"/a.png"})").overlay->content, "/a.png");
  for (const char* name : {"back", "blank", "go", "play", "pause", "next", "previous", "stats",
                           "doctor", "subscribe", "quit"})
    EXPECT_EQ(parse(std::string(R"({"do":")") + name + "\"}").verb, name);
}

TEST(ControlProtocol, UnknownVerbsAndFieldsAreRefusedByName) {
  EXPECT_EQ(complaint(R"({"do":"explode"})"), "do: unknown verb 'explode'");
  EXPECT_EQ(complaint(R"({"do":"pause","hard":true})"), "pause: unknown field 'hard'");
  EXPECT_EQ(complaint(R"({"do":"seek"})"), "seek: frame and item are missing");
  EXPECT_EQ(complaint(R"({"do":"seek","frame":-1})"), "frame: not a whole number of 0 or more");
  EXPECT_EQ(complaint(R"({"do":"seek","frame":1.5})"), "frame: not a whole number of 0 or more");
  EXPECT_EQ(complaint(R"({"do":"seek","frame":1e99})"), "frame: not a whole number of 0 or more");
  EXPECT_EQ(complaint(R"({"do":"load"})"), "load: no source");
  EXPECT_THAT(complaint(R"({"do":"load","source":""})"), testing::StartsWith("source: empty"));
  EXPECT_THAT(complaint(R"({"do":"load","source":"a\u0000b"})"), testing::StartsWith("source: "));
  EXPECT_EQ(complaint(R"({"do":"interrupt"})"), "interrupt: expected either source or item");
  EXPECT_EQ(complaint(R"({"do":"cue","source":"/a","item":1})"),
            "cue: expected either source or item");
  EXPECT_THAT(complaint(R"({"do":"interrupt","item":1,"seconds":0})"),
              testing::StartsWith("seconds: "));
  EXPECT_EQ(complaint(R"({"do":"cue","item":1,"then_back":1})"), "then_back: not true or false");
  for (const char* factor : {"0.09", "8.01", "-1", "\"2\"", "1e400"})
    EXPECT_THAT(complaint(std::string(R"({"do":"speed","factor":)") + factor + "}"),
                testing::Not("none"))
        << factor;
  EXPECT_EQ(complaint(R"({"do":"speed"})"), "speed: no factor");
  EXPECT_EQ(complaint(R"({"do":"power"})"), "power: no to");
  EXPECT_EQ(complaint(R"({"do":"power","to":true})"), "to: not \"on\" or \"off\"");
  EXPECT_EQ(complaint(R"({"do":"rig"})"), "rig: no toml");
  EXPECT_EQ(complaint(R"({"do":"loop","count":0})"), "count: not a number of loops");
  EXPECT_EQ(complaint(R"({"do":"trim"})"), "trim: nothing to change");
  EXPECT_EQ(complaint(R"({"do":"trim","offset":1,"pitch_by":1})"),
            "trim: absolute and relative values cannot be combined");
  EXPECT_EQ(complaint(R"({"do":"snapshot","file":"s.png"})"), "file: not an absolute path");
  EXPECT_EQ(complaint(R"({"do":"snapshot","file":"/s","eye":[0,0,0]})"),
            "eye: not in front of the panel");
  EXPECT_EQ(complaint(R"({"id":1})"), "do: missing, or not a string");
  EXPECT_THAT(complaint(R"({"id":[1],"do":"status"})"), testing::StartsWith("id: "));
}

TEST(ControlProtocol, GarbageIsAnErrorWithTheRequestsIdIfReadable) {
  for (const std::string line : {"", "{", "[]", "7", "null", "status", "{\"do\":\"status\"}}",
                                 "\xff\xfe", "{\"do\":\"\xff\"}"})
    EXPECT_EQ(complaint(line), "request: not a JSON object on one line") << line;
  EXPECT_EQ(complaint(std::string(kMaxControlLine, '[')), "request: not a JSON object on one line");
  json id;
  (void)complaint(R"({"id":"x","do":"explode"})", &id);
  EXPECT_EQ(id, "x");
}

TEST(ControlProtocol, AnswersAreOneLineEach) {
  const std::string line = answer_line(3, {{"text", "a\nb\xff"}});
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1);
  const json answer = json::parse(line);
  EXPECT_EQ(answer["id"], 3);
  EXPECT_EQ(answer["ok"], true);
  const json error =
      json::parse(error_line("x", {ErrorKind::Input, "a.png: no such file", "look for it"}));
  EXPECT_EQ(error["ok"], false);
  EXPECT_EQ(error["error"]["object"], "a.png");
  EXPECT_EQ(error["error"]["cause"], "no such file");
  EXPECT_EQ(error["error"]["remedy"], "look for it");
}

TEST(ControlPeers, OwnerAndRootMayDoEverythingGroupMayControlOthersNothing) {
  const ControlPolicy policy{.owner = 1000, .group = 44};
  EXPECT_EQ(rights_of({.uid = 1000, .groups = {}}, policy), ControlRights::Everything);
  EXPECT_EQ(rights_of({.uid = 0, .groups = {}}, policy), ControlRights::Everything);
  EXPECT_EQ(rights_of({.uid = 1001, .groups = {5, 44}}, policy), ControlRights::Steer);
  EXPECT_EQ(rights_of({.uid = 1001, .groups = {5}}, policy), ControlRights::None);
  EXPECT_EQ(rights_of({.uid = 1001, .groups = {44}}, {.owner = 1000}), ControlRights::None);
}

}  // namespace
}  // namespace lenticule::player
