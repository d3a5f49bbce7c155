// SPDX-License-Identifier: Apache-2.0
#include "player/proof/proof_report.h"

#include <gtest/gtest.h>

#include "tests/unit/player/proof/proof_samples.h"

namespace lenticule::player {
namespace {

using test::kBerlin;
using test::kKiosk;
using test::kNoon;
using test::kSecond;
using test::start_of;
using test::TimeZone;
using test::whole_play;

constexpr int64_t kHour = 3600 * kSecond;

bool none_runs(const ProofEntry& /*entry*/, const ProofOrigin& /*origin*/) { return false; }

/// Returns the report of these entries of the kiosk.
ProofSummary report_of(const std::vector<ProofEntry>& entries, const ReportFilter& filter = {}) {
  ProofReport report(filter);
  for (const ProofEntry& entry : entries) report.add({.proof = entry, .origin = kKiosk});
  return report.finish(none_runs);
}

TEST(ProofReport, SumsThePlaysOfAnItem) {
  ProofEntry second = whole_play(2, "a.lts", kNoon + kSecond);
  second.whole = 2;
  second.interrupted = 1;
  second.missed = 3;
  second.damaged = 4;
  second.unseen = 5;
  second.exactness = "cannot tell";
  second.hash = "sha256:11";
  const ProofSummary summary = report_of(
      {start_of(whole_play(1, "a.lts")), whole_play(1, "a.lts"), start_of(second), second});
  ASSERT_EQ(summary.rows.size(), 1u);
  const ReportRow& row = summary.rows[0];
  EXPECT_EQ(row.day, "2026-10-24");
  EXPECT_EQ(row.item, "a.lts");
  EXPECT_EQ(row.plays(), 4u);
  EXPECT_EQ(row.whole, 3u);
  EXPECT_EQ(row.interrupted, 1u);
  EXPECT_EQ(row.frames, 48u);
  EXPECT_EQ(row.unseen, 5u);
  EXPECT_EQ(row.missed, 3u);
  EXPECT_EQ(row.damaged, 4u);
  EXPECT_EQ(row.exactness, "cannot tell");
  EXPECT_EQ(row.hashes, (std::set<std::string>{"sha256:00", "sha256:11"}));
  EXPECT_EQ(row.panel, "LGD 0x1234");
  EXPECT_EQ(row.unit, "lenticule-player@lobby.service");
}

TEST(ProofReport, SeparatesDaysItemsAndPanelsAndAddsTheTotal) {
  ProofEntry other_panel = whole_play(3, "a.lts");
  other_panel.panel = "virtual";
  const ProofSummary summary = report_of({whole_play(1, "b.lts"), whole_play(2, "a.lts"),
                                          other_panel, whole_play(4, "a.lts", kNoon + 24 * kHour)});
  ASSERT_EQ(summary.rows.size(), 4u);
  EXPECT_EQ(summary.rows[0].item, "a.lts");
  EXPECT_EQ(summary.rows[0].panel, "LGD 0x1234");
  EXPECT_EQ(summary.rows[1].panel, "virtual");
  EXPECT_EQ(summary.rows[2].item, "b.lts");
  EXPECT_EQ(summary.rows[3].day, "2026-10-25");
  EXPECT_EQ(summary.total.plays(), 4u);
  EXPECT_EQ(summary.total.frames, 96u);
}

TEST(ProofReport, ADayIsADayOfTheLocalTimeZone) {
  const ProofEntry late = whole_play(1, "a.lts", kNoon + 11 * kHour);  // 23:00 UTC
  EXPECT_EQ(report_of({late}).rows[0].day, "2026-10-24");
  const TimeZone berlin(kBerlin);
  EXPECT_EQ(report_of({late}).rows[0].day, "2026-10-25");
}

TEST(ProofReport, TheDayOnWhichTheClocksGoBackHas25Hours) {
  const TimeZone berlin(kBerlin);
  const int64_t midnight = *parse_local_time("2026-10-25", 0);
  std::vector<ProofEntry> entries;
  for (uint64_t hour = 0; hour < 26; ++hour)
    entries.push_back(whole_play(hour + 1, "a.lts", midnight + static_cast<int64_t>(hour) * kHour));
  const ProofSummary summary = report_of(entries);
  ASSERT_EQ(summary.rows.size(), 2u);
  EXPECT_EQ(summary.rows[0].whole, 25u);
  EXPECT_EQ(summary.rows[1].day, "2026-10-26");
  EXPECT_EQ(local_time(midnight + 3 * kHour - kHour / 2), "2026-10-25 02:30:00 CEST");
  EXPECT_EQ(local_time(midnight + 4 * kHour - kHour / 2), "2026-10-25 02:30:00 CET");
}

TEST(ProofReport, ATurnWithoutAnEndIsAnInterruptedPlayAndIsNamed) {
  ProofEntry later_part = whole_play(2, "b.lts", kNoon + kSecond);
  later_part.event = ProofEntry::Event::Continues;
  const ProofSummary summary = report_of(
      {start_of(whole_play(1, "a.lts")), whole_play(1, "a.lts"), start_of(later_part), later_part});
  ASSERT_EQ(summary.rows.size(), 2u);
  EXPECT_EQ(summary.rows[1].whole, 1u);
  EXPECT_EQ(summary.rows[1].interrupted, 1u);
  EXPECT_EQ(summary.rows[1].frames, 24u);
  ASSERT_EQ(summary.unended.size(), 1u);
  EXPECT_EQ(summary.unended[0].item, "b.lts");
  EXPECT_EQ(summary.unended[0].counted_until_us, later_part.until_us);
  EXPECT_FALSE(summary.unended[0].running);
}

TEST(ProofReport, TheItemOfARunningPlayerIsNoPlayYet) {
  ProofReport report({});
  report.add({.proof = start_of(whole_play(1, "a.lts")), .origin = kKiosk});
  const ProofSummary summary =
      report.finish([](const ProofEntry& entry, const ProofOrigin& origin) {
        return entry.process_start == 5 && origin.process == 7;
      });
  EXPECT_TRUE(summary.rows.empty());
  ASSERT_EQ(summary.unended.size(), 1u);
  EXPECT_TRUE(summary.unended[0].running);
}

TEST(ProofReport, ATurnThatAnotherFollowedIsOverAlthoughItsPlayerRuns) {
  ProofReport report({.item = "a.lts"});
  report.add({.proof = start_of(whole_play(1, "a.lts")), .origin = kKiosk});
  report.add({.proof = start_of(whole_play(2, "b.lts")), .origin = kKiosk});
  const ProofSummary summary = report.finish([](const auto&, const auto&) { return true; });
  EXPECT_EQ(summary.total.interrupted, 1u);
  ASSERT_EQ(summary.unended.size(), 1u);
  EXPECT_FALSE(summary.unended[0].running);
}

TEST(ProofReport, ARestartedPlayerCountsItsTurnsAnew) {
  ProofEntry after = whole_play(1, "a.lts", kNoon + kSecond);
  after.session = std::string(32, 'f');
  const ProofSummary summary =
      report_of({start_of(whole_play(1, "a.lts")), start_of(after), after});
  ASSERT_EQ(summary.rows.size(), 1u);
  EXPECT_EQ(summary.rows[0].whole, 1u);
  EXPECT_EQ(summary.rows[0].interrupted, 1u) << "the end of the second session is not the first's";
}

TEST(ProofReport, AnotherProgramNeitherAddsToARowOfTheServiceNorEndsItsTurns) {
  ProofReport report({});
  report.add({.proof = start_of(whole_play(1, "a.lts")), .origin = kKiosk});
  const ProofOrigin forger{
      .unit = "user@1000.service", .user = "1000", .program = "/usr/bin/logger"};
  report.add({.proof = whole_play(1, "a.lts"), .origin = forger});
  const ProofSummary summary = report.finish(none_runs);
  ASSERT_EQ(summary.rows.size(), 2u);
  EXPECT_EQ(summary.rows[0].unit, "lenticule-player@lobby.service");
  EXPECT_EQ(summary.rows[0].whole, 0u);
  EXPECT_EQ(summary.rows[0].interrupted, 1u);
  EXPECT_EQ(summary.rows[1].unit, "user 1000: /usr/bin/logger");
}

TEST(ProofReport, IgnoresAndCountsEntriesWithWrongFields) {
  ProofReport report({});
  report.add({.proof = std::nullopt, .origin = kKiosk});
  report.add({.proof = whole_play(1, "a.lts"), .origin = kKiosk});
  const ProofSummary summary = report.finish(none_runs);
  EXPECT_EQ(summary.ignored, 1u);
  EXPECT_EQ(summary.total.plays(), 1u);
}

TEST(ProofReport, ContainsWhatBeganWithinTheTimes) {
  const std::vector<ProofEntry> entries = {whole_play(1, "a.lts", kNoon - kSecond),
                                           start_of(whole_play(2, "b.lts")), whole_play(2, "b.lts"),
                                           whole_play(3, "c.lts", kNoon + kHour)};
  const ProofSummary summary = report_of(entries, {.since_us = kNoon, .until_us = kNoon + kHour});
  ASSERT_EQ(summary.rows.size(), 1u);
  EXPECT_EQ(summary.rows[0].item, "b.lts");
  const ProofSummary half = report_of(entries, {.until_us = kNoon + kSecond / 2});
  EXPECT_EQ(half.total.whole, 2u) << "the end lies after the time, the turn is whole all the same";
  EXPECT_TRUE(half.unended.empty());
}

TEST(ProofReport, SelectsItemsByPathOrFileName) {
  const std::vector<ProofEntry> entries = {whole_play(1, "/films/wave-1.lts"),
                                           whole_play(2, "/films/tree.lts")};
  for (const char* const glob : {"wave*", "/films/w*", "/films/wave-1.lts"})
    EXPECT_EQ(report_of(entries, {.item = glob}).rows.size(), 1u) << glob;
  EXPECT_EQ(report_of(entries, {.item = "*.lts"}).rows.size(), 2u);
  EXPECT_EQ(report_of(entries, {.item = "films"}).rows.size(), 0u);
}

TEST(LocalTime, IsParsedInTheTimeZoneOfTheMachine) {
  const TimeZone berlin(kBerlin);
  EXPECT_EQ(parse_local_time("2026-10-24", 0), kNoon - 14 * kHour);
  EXPECT_EQ(parse_local_time("2026-10-24 14:00", 0), kNoon);
  EXPECT_EQ(parse_local_time("2026-10-24 14:00:01", 0), kNoon + kSecond);
  EXPECT_EQ(parse_local_time("today", kNoon), kNoon - 14 * kHour);
  EXPECT_EQ(parse_local_time("yesterday", kNoon), kNoon - 38 * kHour);
  EXPECT_EQ(parse_local_time("today", kNoon + 36 * kHour), kNoon + 35 * kHour)
      << "the day after the clocks went back";
}

TEST(LocalTime, RefusesTextsThatAreNoTime) {
  for (const char* const text :
       {"", "now", "2026", "2026-10", "2026-13-01", "2026-02-30", "2026-1-1", "26-10-24",
        "2026-10-24 14", "2026-10-24 24:00", "2026-10-24 14:60", "2026-10-24 14:00:00:00",
        "2026-10-24T14:00", "2026-10-24 14:00 ", "-2026-10-24", "2026-10--1"})
    EXPECT_FALSE(parse_local_time(text, kNoon)) << text;
}

}  // namespace
}  // namespace lenticule::player
