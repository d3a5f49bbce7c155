// SPDX-License-Identifier: Apache-2.0
#include "farm/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "small_farm.h"
#include "tests/support/error_matchers.h"
#include "tests/support/process.h"

namespace lenticule::farm {
namespace {

using test::error_of;
using test::small_plan;

TEST(Plan, DividesAFilmIntoChunksOfWhichTheLastIsShorter) {
  const Plan plan = small_plan(5, 30, 10);
  ASSERT_EQ(plan.chunks(), 3U);
  EXPECT_EQ(plan.chunk(0).begin, 5U);
  EXPECT_EQ(plan.chunk(1).end, 25U);
  EXPECT_EQ(plan.chunk(2).begin, 25U);
  EXPECT_EQ(plan.chunk(2).end, 30U);
}

TEST(Plan, IsTheSameAfterWritingAndReading) {
  Plan plan = small_plan(5, 30, 10);
  plan.chunk_inputs = {"0a", "0b", "0c"};
  plan.output = "/films/one film.lts";
  const Plan again = parse_plan(plan_to_json(plan), "plan.json");
  EXPECT_EQ(plan_to_json(again), plan_to_json(plan));
  EXPECT_EQ(again.arguments, plan.arguments);
  EXPECT_EQ(again.film, plan.film);
  EXPECT_EQ(again.timing.peak_bytes, plan.timing.peak_bytes);
}

TEST(Plan, ItsIdentityChangesWithEverythingThatTheFilmDependsOn) {
  const std::string identity = small_plan(0, 30, 10).identity();
  EXPECT_EQ(identity.size(), 32U);
  Plan timed = small_plan(0, 30, 10);
  timed.timing.frame_seconds = 99.0;
  timed.output = "/elsewhere.lts";
  EXPECT_EQ(timed.identity(), identity);
  EXPECT_NE(small_plan(0, 31, 10).identity(), identity);
  EXPECT_NE(small_plan(0, 30, 9).identity(), identity);
  for (const auto change :
       std::vector<void (*)(Plan&)>{[](Plan& plan) { plan.program = "lenticule 2"; },
                                    [](Plan& plan) { plan.arguments.emplace_back("--samples=4"); },
                                    [](Plan& plan) { plan.inputs["scene"] = "00fe"; },
                                    [](Plan& plan) { plan.film.rig_fingerprint = "x"; }}) {
    Plan changed = small_plan(0, 30, 10);
    change(changed);
    EXPECT_NE(changed.identity(), identity);
  }
}

TEST(Plan, RefusesAPlanThatWasEdited) {
  std::string text = plan_to_json(small_plan(0, 30, 10));
  const size_t at = text.find("00ff");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 4, "00fe");
  const Error error = error_of([&] { (void)parse_plan(text, "plan.json"); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_STREQ(error.what(), "plan.json: was changed after it was made");
}

TEST(Plan, NamesTheKeyThatIsWrong) {
  const std::string good = plan_to_json(small_plan(0, 30, 10));
  for (const auto& [from, to, says] : std::vector<std::array<const char*, 3>>{
           {"\"format\": 1", "\"format\": 9", "plan.json: another format of plans"},
           {"\"chunk_frames\": 10", "\"chunk_frames\": 0", "plan.json: chunk_frames: zero"},
           {"\"width\": 30", "\"width\": -30", "plan.json: width: not a whole number"},
           {"\"program\"", "\"progam\"", "plan.json: program: missing"},
           {"{", "[", "plan.json: not JSON"}}) {
    std::string text = good;
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, std::string(from).size(), to);
    const Error error = error_of([&] { (void)parse_plan(text, "plan.json"); });
    EXPECT_EQ(std::string(error.what()).rfind(says, 0), 0U) << error.what();
  }
}

TEST(Plan, CommandsAreWholeLinesThatAShellReadsBack) {
  const std::string folder = "/shared/a 'b\" $(c) \\d;e/work";
  const std::string text = commands_text(small_plan(0, 30, 10), "/opt/my tools/lenticule", folder);
  std::string shown;
  std::istringstream lines(text);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const test::ProcessResult words =
        test::run_process({"/bin/sh", "-c", "printf '%s\\n' " + line});
    EXPECT_EQ(words.out, "/opt/my tools/lenticule\nfarm\nrender\n" + folder + "\n" +
                             std::to_string(count) + "\n");
  }
  EXPECT_EQ(count, 3);
  EXPECT_EQ(error_of([] { (void)commands_text(small_plan(0, 1, 1), "lenticule", "/a\nb"); }).kind(),
            ErrorKind::Usage);
}

TEST(Plan, ChunksThatPublishPredictorsAreStartedEarlier) {
  const Plan plan = small_plan(7, 3007, 1);
  const std::vector<uint64_t> order = chunk_order(plan);
  std::vector<uint64_t> place(order.size(), order.size());
  for (size_t i = 0; i < order.size(); ++i) place[order[i]] = i;
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
    ASSERT_LT(place[chunk], order.size()) << "every chunk has a place";
    const uint64_t publisher = chunk - chunk % 32;
    if (publisher == chunk) continue;
    EXPECT_LT(place[publisher], place[chunk]);
    if (chunk > 1024) {
      EXPECT_GE(place[chunk] - place[publisher], 900U);
    }
    EXPECT_LT(place[chunk], chunk + 40) << "a film that is fed to a player comes in order";
  }
  // Chunks of whole intervals need nothing of each other.
  const std::vector<uint64_t> plain = chunk_order(small_plan(0, 3000, 64));
  EXPECT_TRUE(std::is_sorted(plain.begin(), plain.end()));
}

/// Returns the work of all chunks over that of one run.
double overhead(const FrameTiming& timing, uint64_t film, uint64_t chunk) {
  double extra = 0.0;
  for (uint64_t begin = 0; begin < film; begin += chunk)
    extra += timing.start_seconds + (begin % 32 == 0 ? 0.0 : timing.frame_seconds);
  const double one = timing.start_seconds + timing.frame_seconds * static_cast<double>(film);
  return (one - timing.start_seconds + extra) / one;
}

TEST(Plan, ChunksOfAutomaticLengthCostAtMostATwentiethMore) {
  for (const double frame : {0.05, 1.0, 8.0, 30.0, 160.0, 900.0}) {
    for (const double start : {0.2, 5.0, 60.0}) {
      const FrameTiming timing{.frames = 3, .start_seconds = start, .frame_seconds = frame};
      for (const uint64_t film : {24U, 240U, 750U, 20000U}) {
        const uint64_t chunk = choose_chunk_frames(timing, film, 1);
        ASSERT_GE(chunk, 1U);
        ASSERT_LE(chunk, film);
        EXPECT_LE(overhead(timing, film, chunk), 1.08) << frame << " " << start << " " << film;
      }
    }
  }
}

TEST(Plan, SlowFramesMakeShortChunks) {
  const FrameTiming slow{.frames = 3, .start_seconds = 1.0, .frame_seconds = 160.0};
  const FrameTiming fast{.frames = 3, .start_seconds = 1.0, .frame_seconds = 1.0};
  EXPECT_LE(choose_chunk_frames(slow, 750, 1), 20U);
  EXPECT_GE(choose_chunk_frames(fast, 75000, 1), 100U);
  EXPECT_LE(choose_chunk_frames(fast, 75000, 1), 200U);
  EXPECT_GE(choose_chunk_frames(slow, 2'000'000, 1), 200U) << "at most 10 000 chunks";
  // A method that depends on earlier frames gets whole intervals.
  EXPECT_EQ(choose_chunk_frames(slow, 750, 32) % 32, 0U);
}

}  // namespace
}  // namespace lenticule::farm
