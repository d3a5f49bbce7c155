// SPDX-License-Identifier: Apache-2.0
// Tests the sums behind `lenticule bench paper`.
#include "apps/lenticule-bench/render/bench_paper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

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

TEST(KioskRig, IsTheSampleRig) {
  const optics::Rig file =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
  EXPECT_EQ(optics::fingerprint(lab::kiosk_rig()), optics::fingerprint(file));
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

}  // namespace
}  // namespace lenticule::bench
