// SPDX-License-Identifier: Apache-2.0
// Tests the sums behind `lenticule bench paper`.
#include "apps/lenticule-bench/render/bench_paper.h"

#include <gtest/gtest.h>

#include <cmath>

#include "apps/lenticule-bench/harness/bench.h"
#include "optics/rig_file.h"

namespace lenticule::bench {
namespace {

TEST(PaperFigures, ThePapersPsnrFollowsFromItsColumnAsSquaredError) {
  for (const PublishedQuality& row : published_quality())
    EXPECT_NEAR(10.0 * std::log10(255.0 * 255.0 / row.column), row.psnr_db, 2e-4) << row.frame;
}

TEST(PaperFigures, TheRigIsTheSampleRig) {
  const optics::Rig file =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/paper-64.toml");
  EXPECT_EQ(optics::fingerprint(lab::paper_rig()), optics::fingerprint(file));
}

TEST(PaperSpans, CoverASequenceOrLieEvenlyInIt) {
  const std::vector<PaperSpan> all = spans_of("teapot", 612, 16, 0);
  ASSERT_EQ(all.size(), 39U);
  int next = 0;
  for (const PaperSpan& span : all) {
    EXPECT_EQ(span.first, next);
    next += span.count;
  }
  EXPECT_EQ(next, 612);

  const std::vector<PaperSpan> two = spans_of("teapot", 612, 16, 2);
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[0].first, 9 * 16);
  EXPECT_EQ(two[1].first, 29 * 16);
  EXPECT_EQ(spans_of("teapot", 20, 16, 9).size(), 2U);
}

nlohmann::json figures(double wall, std::optional<double> mse) {
  nlohmann::json out = {{"wall_s", wall}, {"cpu_s", 2 * wall}, {"build_s", 0.5},
                        {"rays", 30},     {"subpixels", 10},   {"traced", 4},
                        {"projected", 5}, {"interpolated", 1}, {"missing", 2}};
  if (!mse) return out;
  out["mse"] = {*mse - 1, *mse, *mse + 1};
  out["max"] = 7;
  out["share_over_8"] = 0.25;
  out["share_over_32"] = 0.125;
  out["worst_view_mse"] = 2 * *mse;
  return out;
}

TEST(PaperSummary, AddsUpFramesOfAllSpans) {
  const auto frame = [](int number, double mse) {
    return nlohmann::json{{"frame", number},
                          {"methods", {{"full", figures(4, {})}, {"hybrid", figures(1, mse)}}}};
  };
  // "hybrid" is an example of a method; names that this build lacks are skipped.
  const nlohmann::json span = {{"scene", "teapot"}, {"first", 0}, {"frames", {frame(3, 1)}}};
  const nlohmann::json later = {{"scene", "teapot"}, {"first", 16}, {"frames", {frame(20, 100)}}};
  const nlohmann::json summary = summarize("teapot", {span, later});
  EXPECT_EQ(summary["frames"], 2);
  EXPECT_EQ(summary["frames_of_sequence"], 612);
  EXPECT_EQ(summary["methods"][0]["name"], "full");
  EXPECT_DOUBLE_EQ(summary["methods"][0]["seconds_per_frame"], 4.0);
  EXPECT_DOUBLE_EQ(summary["methods"][0]["saved"], 0.0);
  EXPECT_TRUE(summary["methods"][0]["psnr_mean_db"].is_null());
  EXPECT_DOUBLE_EQ(summary["methods"][0]["rays_per_subpixel"], 3.0);
}

}  // namespace
}  // namespace lenticule::bench
