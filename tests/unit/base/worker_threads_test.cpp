// SPDX-License-Identifier: Apache-2.0
#include "base/worker_threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

#include "base/parallel_rows.h"
#include "tests/support/little_memory.h"

namespace lenticule {
namespace {

TEST(WorkerThreads, DoesEveryJobOnceInEveryRun) {
  WorkerThreads threads(3);
  ASSERT_EQ(threads.count(), 3);
  for (const int jobs : {0, 1, 2, 100}) {
    std::vector<std::atomic<int>> done(static_cast<size_t>(jobs));
    threads.run(jobs, [&](int job, int worker) {
      EXPECT_TRUE(worker >= 0 && worker < 3) << worker;
      ++done[static_cast<size_t>(job)];
    });
    for (const auto& times : done) EXPECT_EQ(times, 1);
  }
}

TEST(WorkerThreads, PassesAnExceptionOnAndWorksAgain) {
  WorkerThreads threads(2);
  const auto fail = [](int job, int /*worker*/) {
    if (job == 5) throw std::runtime_error("job 5");
  };
  EXPECT_THROW(threads.run(10, fail), std::runtime_error);
  std::atomic<int> done = 0;
  threads.run(10, [&](int, int) { ++done; });
  EXPECT_EQ(done, 10);
}

TEST(RowRanges, CoverEveryRowOnceAndPassAnExceptionOn) {
  for (const int rows : {0, 1, 8, 9, 100}) {
    std::vector<std::atomic<int>> done(static_cast<size_t>(rows));
    for_rows(
        rows, [&](int row) { ++done[static_cast<size_t>(row)]; }, 3);
    for (const auto& times : done) EXPECT_EQ(times, 1);
  }
  EXPECT_THROW(for_rows(
                   100, [](int) { throw std::runtime_error("row"); }, 3),
               std::runtime_error);
}

#if LENTICULE_LIMITS_MEMORY
TEST(WorkerThreads, WorksWithTheThreadsThatTheSystemAllows) {
  const test::LittleMemory limit(test::kFewStacks);
  WorkerThreads threads(64);
  EXPECT_GT(threads.count(), 1);
  EXPECT_LT(threads.count(), 64);
  std::atomic<int> done = 0;
  threads.run(1000, [&](int, int) { ++done; });
  EXPECT_EQ(done, 1000);
}
#endif

}  // namespace
}  // namespace lenticule
