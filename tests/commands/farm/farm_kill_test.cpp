// SPDX-License-Identifier: Apache-2.0
// Kills workers of a film at random moments.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <list>
#include <memory>
#include <random>

#include "farm_fixture.h"

namespace lenticule::test {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kKills = 60;

/// Runs the commands of a list in a random order, several at the same time, and kills them until
/// the number of kills is reached. A chunk may be given to two workers at once. Then all commands
/// run to their end.
class FarmKill : public FarmTest {
 protected:
  struct Worker {
    std::unique_ptr<BackgroundProcess> process;
    Clock::time_point end;
  };

  void kill_workers(int kills, size_t at_once) {
    std::mt19937 random(17);
    const auto begin = Clock::now();
    ASSERT_EQ(render_chunk(0).exit_code, 0);
    const double whole = std::chrono::duration<double>(Clock::now() - begin).count();
    std::uniform_real_distribution<double> moment(0.0, 1.3 * whole * static_cast<double>(at_once));
    std::list<Worker> workers;
    int killed = 0;
    while (killed < kills) {
      while (workers.size() < at_once) {
        const auto life = std::chrono::duration<double>(moment(random));
        workers.push_back({std::make_unique<BackgroundProcess>(chunk_words(random() % chunks())),
                           Clock::now() + std::chrono::duration_cast<Clock::duration>(life)});
      }
      usleep(3000);
      for (auto worker = workers.begin(); worker != workers.end();) {
        if (Clock::now() < worker->end) {
          ++worker;
          continue;
        }
        worker->process->signal(SIGKILL);
        const ProcessResult result = worker->process->wait(std::chrono::seconds(300));
        ASSERT_TRUE(result.signal == SIGKILL || result.exit_code == 0) << result.err;
        if (result.signal == SIGKILL) ++killed;
        worker = workers.erase(worker);
      }
      if (killed == kills || !status_is_complete()) continue;
      workers.clear();
      begin_again();
    }
    workers.clear();
    std::vector<uint64_t> order;
    for (uint64_t chunk = 0; chunk < chunks(); ++chunk) order.push_back(chunk);
    std::shuffle(order.begin(), order.end(), random);
    for (const uint64_t chunk : order) ASSERT_EQ(render_chunk(chunk).exit_code, 0);
  }

  [[nodiscard]] bool status_is_complete() const {
    const auto reports = std::filesystem::directory_iterator(work() + "/reports");
    return static_cast<uint64_t>(std::distance(reports, {})) == chunks();
  }

  /// Checks the film, and makes every chunk missing.
  void begin_again() {
    ASSERT_EQ(merge().exit_code, 0);
    ASSERT_EQ(film(), expected_);
    for (const char* part : {"reports", "chunks", "predictors"})
      for (const auto& entry : std::filesystem::directory_iterator(work() + "/" + part))
        std::filesystem::remove(entry.path());
    ++rounds_;
  }

  void expect_film_after_kills(const std::string& frames, const std::string& chunk, int kills) {
    expected_ = film_of_one_run(frames);
    plan(frames, chunk);
    kill_workers(kills, 3);
    ASSERT_EQ(status().at("complete"), true);
    ASSERT_EQ(merge().exit_code, 0);
    EXPECT_EQ(film(), expected_);
    EXPECT_TRUE(std::filesystem::is_empty(work() + "/attempts"));
    GTEST_LOG_(INFO) << kills << " kills; " << rounds_ << " films before the last one";
  }

  std::vector<uint8_t> expected_;
  int rounds_ = 0;
};

/// The number of kills is that of the environment's FARM_KILLS.
TEST_F(FarmKill, AfterManyKillsTheFilmOf240FramesHasTheBytesOfOneRun) {
  const char* kills = std::getenv("FARM_KILLS");
  expect_film_after_kills("0:240", "10", kills != nullptr ? std::stoi(kills) : kKills);
}

}  // namespace
}  // namespace lenticule::test
