// SPDX-License-Identifier: Apache-2.0
// Checks on random films that chunks of any length, rendered in any order, some twice, some damaged
// and rendered again, give the film of one run.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "base/error.h"
#include "farm/plan.h"
#include "farm/work_folder.h"
#include "tests/unit/farm/small_farm.h"

namespace lenticule::farm {
namespace {

using test::small_plan;
using test::SmallFarm;

/// Truncates the file of a chunk or changes a byte.
void damage(const SmallFarm& farm, uint64_t chunk, std::mt19937& random) {
  const auto file = farm.chunk_file(chunk);
  std::vector<uint8_t> bytes = test::read_bytes(file);
  if (random() % 2 == 0) {
    bytes.resize(random() % bytes.size());
  } else {
    bytes[random() % bytes.size()] ^= static_cast<uint8_t>(1 + random() % 255);
  }
  test::write_bytes(file, bytes);
}

TEST(FarmProperty, EveryPlanCoversEachFrameOnce) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const uint64_t begin = random() % 1000;
    const Plan plan = small_plan(begin, begin + 1 + random() % 3000, 1 + random() % 200);
    uint64_t next = plan.begin;
    for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
      ASSERT_EQ(plan.chunk(chunk).begin, next);
      ASSERT_GT(plan.chunk(chunk).end, next);
      next = plan.chunk(chunk).end;
    }
    ASSERT_EQ(next, plan.end);
    ASSERT_EQ(parse_plan(plan_to_json(plan), "plan").identity(), plan.identity());
  }
}

TEST(FarmProperty, AnyOrderOfChunksGivesTheFilmOfOneRun) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 8; ++trial) {
    const uint64_t begin = random() % 50;
    const SmallFarm farm(small_plan(begin, begin + 1 + random() % 90, 3 + random() % 40));
    std::vector<uint64_t> order;
    for (uint64_t chunk = 0; chunk < farm.plan().chunks(); ++chunk)
      order.insert(order.end(), 1 + random() % 2, chunk);
    std::shuffle(order.begin(), order.end(), random);
    for (const uint64_t chunk : order) ASSERT_TRUE(farm.render(chunk));
    damage(farm, random() % farm.plan().chunks(), random);
    EXPECT_THROW((void)merge_film(farm.folder(), farm.film()), Error);
    const std::vector<uint64_t> missing = missing_chunks(farm.folder());
    ASSERT_EQ(missing.size(), 1U);
    ASSERT_TRUE(farm.render(missing.front()));
    (void)merge_film(farm.folder(), farm.film());
    ASSERT_EQ(test::read_bytes(farm.film()), farm.film_of_one_run()) << trial;
  }
}

}  // namespace
}  // namespace lenticule::farm
