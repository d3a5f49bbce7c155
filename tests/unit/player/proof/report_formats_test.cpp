// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "player/proof/proof_report.h"
#include "tests/unit/player/proof/proof_samples.h"

namespace lenticule::player {
namespace {

using test::kKiosk;
using test::start_of;
using test::whole_play;

ProofSummary summary_of(const std::vector<ProofEntry>& entries) {
  ProofReport report({});
  for (const ProofEntry& entry : entries) report.add({.proof = entry, .origin = kKiosk});
  return report.finish([](const auto&, const auto& origin) { return origin.process == 8; });
}

TEST(ReportFormats, TheTableHasARowPerItemAndATotal) {
  ProofEntry second = whole_play(2, "grün.lts");
  second.frames = 100;
  second.heard_ms = 3'599'960;
  second.silent_ms = 250;
  EXPECT_EQ(table_text(summary_of({whole_play(1, "wave.lts"), second})),
            "day         item      plays  whole  interrupted  frames  missed  damaged  heard s  "
            "silent s  exactness  panel       unit\n"
            "2026-10-24  grün.lts      1      1            0     100       0        0   3600.0  "
            "     0.2  yes        LGD 0x1234  lenticule-player@lobby.service\n"
            "2026-10-24  wave.lts      1      1            0      24       0        0           "
            "          yes        LGD 0x1234  lenticule-player@lobby.service\n"
            "total                     2      2            0     124       0        0   3600.0  "
            "     0.2  yes\n");
}

TEST(ReportFormats, TheTableNamesInterruptedItemsUnseenFramesAndIgnoredEntries) {
  ProofEntry unseen = whole_play(1, "a.lts");
  unseen.unseen = 7;
  ProofSummary summary = summary_of({unseen, start_of(whole_play(2, "b.lts"))});
  summary.ignored = 3;
  const std::string text = table_text(summary);
  EXPECT_NE(text.find("interrupted: b.lts (lenticule-player@lobby.service): the player or the "
                      "machine stopped after 2026-10-24 12:00:00 UTC"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("unseen: 7 more frames"), std::string::npos) << text;
  EXPECT_NE(text.find("ignored: 3 entries"), std::string::npos) << text;
}

TEST(ReportFormats, AnEmptyReportSaysSo) {
  EXPECT_EQ(table_text(summary_of({})), "no plays are recorded for this time\n");
  EXPECT_EQ(csv_text(summary_of({})),
            "day,item,hashes,plays,whole,interrupted,frames,unseen,missed,damaged,exactness,panel,"
            "unit,heard_s,silent_s,sound_devices\n");
  EXPECT_EQ(to_json(summary_of({}))["rows"].size(), 0u);
}

TEST(ReportFormats, SoundIsSummedAndAbsentWithoutSound) {
  ProofEntry first = whole_play(1, "a.mkv"), second = whole_play(2, "a.mkv");
  first.heard_ms = 1500;
  second.heard_ms = 500;
  second.silent_ms = 750;
  first.sound_device = "plughw:0,3";
  second.sound_device = "default";
  const ProofSummary summary = summary_of({first, second, whole_play(3, "b.lts")});
  const std::string csv = csv_text(summary);
  EXPECT_NE(csv.find(".service,2.0,0.8,\"default plughw:0,3\"\n"), std::string::npos) << csv;
  EXPECT_TRUE(csv.ends_with(".service,,,\n")) << csv;
  const nlohmann::ordered_json json = to_json(summary);
  const nlohmann::ordered_json sound = json["rows"][0]["sound"];
  EXPECT_EQ(sound["heard_s"], 2.0);
  EXPECT_EQ(sound["silent_s"], 0.75);
  EXPECT_EQ(sound["devices"].size(), 2u);
  EXPECT_EQ(json["total"]["sound"]["heard_s"], 2.0);
  EXPECT_FALSE(json["rows"][1].contains("sound"));
}

TEST(ReportFormats, HostileTextsReachNeitherTerminalNorSpreadsheet) {
  const ProofSummary summary =
      summary_of({whole_play(1, "=cmd(\"x\"),\x1b[2J\n.lts"), whole_play(2, "-1+1")});
  EXPECT_EQ(table_text(summary).find('\x1b'), std::string::npos);
  const std::string csv = csv_text(summary);
  EXPECT_NE(
      csv.find("2026-10-24,\"'=cmd(\"\"x\"\"),\\x1b[2J\\x0a.lts\",sha256:00,1,1,0,24,0,0,0,yes,"),
      std::string::npos)
      << csv;
  EXPECT_NE(csv.find("2026-10-24,'-1+1,"), std::string::npos) << csv;
}

TEST(ReportFormats, JsonHasRowsTotalsAndTheItemsWithoutAnEnd) {
  const nlohmann::ordered_json json =
      to_json(summary_of({whole_play(1, "a.lts"), start_of(whole_play(2, "b.lts"))}));
  EXPECT_EQ(json["rows"].size(), 2u);
  EXPECT_EQ(json["rows"][0]["item"], "a.lts");
  EXPECT_EQ(json["rows"][0]["hashes"][0], "sha256:00");
  EXPECT_EQ(json["rows"][0]["frames"], 24);
  EXPECT_EQ(json["rows"][1]["interrupted"], 1);
  EXPECT_EQ(json["total"]["plays"], 2);
  EXPECT_EQ(json["without_end"][0]["item"], "b.lts");
  EXPECT_TRUE(json["playing"].empty());
}

}  // namespace
}  // namespace lenticule::player
