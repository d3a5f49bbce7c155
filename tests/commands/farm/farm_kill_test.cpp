// SPDX-License-Identifier: Apache-2.0
// Kills workers of a film at random moments.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <list>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "farm_fixture.h"

namespace lenticule::test {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kKills = 24;
constexpr size_t kAtOnce = 3;

/// Runs the commands of a list in a random order, several at the same time, and kills them until
/// the number of kills is reached. A chunk may be given to two workers at once. Then all commands
/// run to their end.
///
/// A third of the workers is killed at any moment of a life. The others are killed shortly after
/// they have reached a random stage, since writing and renaming take a small part of a life.
class FarmKill : public FarmTest {
 protected:
  enum Stage : uint8_t { Starting, Loading, Writing, Renaming, Ending, Stages };
  static constexpr std::array<const char*, Stages> kNames = {"starting", "loading", "writing",
                                                             "renaming", "ending"};

  struct Worker {
    std::unique_ptr<BackgroundProcess> process;
    uint64_t chunk;
    Stage stage;  ///< first stage in which the worker may be killed
    Clock::duration delay;
    bool was_done;  ///< when the worker started
    Clock::time_point latest = Clock::now() + std::chrono::seconds(60);
    std::optional<Clock::time_point> end{};
  };

  /// Returns the stage of a chunk, from the files of the work folder. A worker that was killed
  /// earlier may have left some of them.
  [[nodiscard]] Stage stage_of(uint64_t chunk) const {
    namespace fs = std::filesystem;
    char digits[8];
    (void)snprintf(digits, sizeof digits, "%06d", static_cast<int>(chunk));
    std::error_code error;
    if (fs::exists(work() + "/reports/" + digits + ".json", error)) return Ending;
    if (!chunk_file(chunk).empty()) return Renaming;
    Stage stage = Starting;
    fs::recursive_directory_iterator at(work() + "/attempts/" + digits, error);
    for (; !error && at != fs::end(at); at.increment(error)) {
      const std::string name = at->path().filename().string();
      if (name == "chunk.lts" || name.find("report") != std::string::npos) return Renaming;
      if (name.find("chunk.lts") != std::string::npos) return Writing;
      stage = Loading;
    }
    return stage;
  }

  [[nodiscard]] Worker start_worker() {
    std::uniform_real_distribution<double> moment(0.0, 1.3 * life_ * kAtOnce);
    std::exponential_distribution<double> soon(1.0 / 0.004);
    const uint64_t chunk = random_() % chunks();
    const bool at_any_moment = random_() % 3 == 0;
    const auto stage = at_any_moment ? Starting : static_cast<Stage>(Loading + random_() % 4);
    const std::chrono::duration<double> delay(at_any_moment ? moment(random_) : soon(random_));
    return {.process = std::make_unique<BackgroundProcess>(chunk_words(chunk)),
            .chunk = chunk,
            .stage = stage,
            .delay = std::chrono::duration_cast<Clock::duration>(delay),
            .was_done = stage_of(chunk) == Ending};
  }

  /// Kills a worker whose moment has come. Returns true if the worker has ended.
  [[nodiscard]] bool kill_in_time(Worker& worker) {
    const Stage stage = worker.was_done ? Starting : stage_of(worker.chunk);
    if (stage == Writing && worker.stage == Renaming) {
      kill_while_renaming(worker);
    } else {
      const bool reached = stage >= worker.stage || worker.was_done || Clock::now() > worker.latest;
      if (!worker.end && reached) worker.end = Clock::now() + worker.delay;
      if (!worker.end || Clock::now() < *worker.end) return false;
      worker.process->signal(SIGKILL);
    }
    const ProcessResult result = worker.process->wait(std::chrono::seconds(300));
    EXPECT_TRUE(result.signal == SIGKILL || result.exit_code == 0) << result.err;
    if (result.signal == SIGKILL) {
      ++killed_;
      ++killed_in_[worker.was_done ? Starting : stage_of(worker.chunk)];
    }
    return true;
  }

  /// Waits without a pause, since the files of a chunk are renamed within a millisecond.
  void kill_while_renaming(const Worker& worker) {
    const auto latest = Clock::now() + std::chrono::seconds(5);
    while (stage_of(worker.chunk) <= Writing && Clock::now() < latest) continue;
    usleep(static_cast<useconds_t>(random_() % 300));
    worker.process->signal(SIGKILL);
  }

  void kill_workers(int kills) {
    const auto begin = Clock::now();
    ASSERT_EQ(render_chunk(0).exit_code, 0);
    life_ = std::chrono::duration<double>(Clock::now() - begin).count();
    std::list<Worker> workers;
    while (killed_ < kills && !HasFailure()) {
      while (workers.size() < kAtOnce) workers.push_back(start_worker());
      usleep(300);
      workers.remove_if([&](Worker& worker) { return kill_in_time(worker); });
      if (killed_ == kills || !reports_are_complete()) continue;
      workers.clear();
      begin_again();
    }
    workers.clear();
    std::vector<uint64_t> order;
    for (uint64_t chunk = 0; chunk < chunks(); ++chunk) order.push_back(chunk);
    std::shuffle(order.begin(), order.end(), random_);
    for (const uint64_t chunk : order) ASSERT_EQ(render_chunk(chunk).exit_code, 0);
  }

  [[nodiscard]] bool reports_are_complete() const {
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
    kill_workers(kills);
    ASSERT_EQ(status().at("complete"), true);
    ASSERT_EQ(merge().exit_code, 0);
    EXPECT_EQ(film(), expected_);
    EXPECT_TRUE(std::filesystem::is_empty(work() + "/attempts"));
    std::string stages;
    for (size_t stage = 0; stage < Stages; ++stage)
      stages += "; " + std::to_string(killed_in_[stage]) + " " + kNames[stage];
    GTEST_LOG_(INFO) << killed_ << " kills" << stages << "; " << rounds_
                     << " films before the last one";
  }

 private:
  std::mt19937 random_{17};
  std::vector<uint8_t> expected_;
  double life_ = 0.0;  ///< seconds that a worker takes
  int killed_ = 0;
  std::array<int, Stages> killed_in_{};
  int rounds_ = 0;
};

/// The number of kills is that of the environment's FARM_KILLS.
TEST_F(FarmKill, AfterManyKillsTheFilmOf240FramesHasTheBytesOfOneRun) {
  const char* kills = std::getenv("FARM_KILLS");
  expect_film_after_kills("0:240", "10", kills != nullptr ? std::stoi(kills) : kKills);
}

}  // namespace
}  // namespace lenticule::test
