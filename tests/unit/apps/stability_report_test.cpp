// SPDX-License-Identifier: Apache-2.0
// Tests which rows of the table of `bench stability` pass.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <stdexcept>

#include "lab/stability/rows.h"

namespace lenticule::bench {
namespace {

using lab::StabilityReport;
using lab::StabilityRow;

constexpr lab::StabilityCase kGood = {"good", "nothing", "rays", "holes", nullptr, 1e-9, "lens"};
constexpr lab::StabilityCase kBad = {"bad", "nothing", "rays", "holes", nullptr, 1e-9, "lens"};

StabilityRow good_row() {
  return {.of = &kGood, .tally = {.samples = 12345678, .failures = 0, .worst = 1e-12}};
}

TEST(StabilityRow, PassesWithinItsBoundsIfItWasMeasured) {
  const auto passes_with = [](const auto& change) {
    StabilityRow row = good_row();
    change(row);
    return passes(row);
  };
  EXPECT_TRUE(passes_with([](StabilityRow&) {}));
  EXPECT_TRUE(passes_with([](StabilityRow& row) { row.tally.worst = kGood.bound; }));
  EXPECT_TRUE(
      passes_with([](StabilityRow& row) { row.tally.failures = row.failures_allowed = 3; }));
  EXPECT_FALSE(passes_with([](StabilityRow& row) { row.tally.failures = 1; }));
  EXPECT_FALSE(passes_with([](StabilityRow& row) { row.tally.worst = 1.1e-9; }));
  EXPECT_FALSE(passes_with([](StabilityRow& row) { row.tally.samples = 0; }));
  EXPECT_FALSE(passes_with([](StabilityRow& row) { row.tally.worst = std::nan(""); }));
}

TEST(StabilityReport, TextAndJsonAgree) {
  StabilityReport report{.seconds = 1.0, .rows = {good_row(), good_row()}};
  report.rows[1].of = &kBad;
  report.rows[1].tally.failures = 7;
  const std::string text = to_text(report);
  EXPECT_NE(text.find("pass good  12 345 678 rays: 0 holes; error 1e-12 of 1e-09 lens"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("FAIL bad   12 345 678 rays: 7 holes"), std::string::npos) << text;
  EXPECT_NE(text.find("1 of 2 rows pass"), std::string::npos) << text;
  const nlohmann::json json = to_json(report);
  EXPECT_EQ(json["passes"], false);
  EXPECT_EQ(json["rows"][0]["passes"], true);
  EXPECT_EQ(json["rows"][1]["passes"], false);
  EXPECT_EQ(json["rows"][1]["failures"], 7);
}

TEST(Tally, CountsNonFiniteNumbersAsInfiniteErrors) {
  lab::Tally tally;
  tally.check(true);
  tally.check(false);
  tally.error(1e-3);
  tally.error(std::numeric_limits<double>::quiet_NaN());
  const lab::Tally sum =
      lab::tally_parts({.threads = 2}, 2, [&](uint64_t, lab::Tally& part) { part = tally; });
  EXPECT_EQ(sum.samples, 4U);
  EXPECT_EQ(sum.failures, 2U);
  EXPECT_EQ(sum.worst, std::numeric_limits<double>::infinity());
}

TEST(ForEachPart, RunsEveryPartOnceAndRethrows) {
  for (const int threads : {1, 3}) {
    std::vector<std::atomic<int>> done(100);
    lab::for_each_part({.threads = threads}, done.size(), [&](uint64_t k) { ++done[k]; });
    for (const auto& times : done) EXPECT_EQ(times.load(), 1);
    EXPECT_THROW(lab::for_each_part({.threads = threads}, 10,
                                    [](uint64_t k) {
                                      if (k == 5) throw std::runtime_error("5");
                                    }),
                 std::runtime_error);
  }
}

}  // namespace
}  // namespace lenticule::bench
