// SPDX-License-Identifier: Apache-2.0
// Tests the farm with a real Slurm of two nodes on this machine.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <memory>
#include <optional>

#include "farm_fixture.h"
#include "slurm_cluster.h"

namespace lenticule::test {
namespace {

constexpr std::chrono::seconds kLong{600};

class FarmSlurm : public FarmTest {
 protected:
  void SetUp() override {
    FarmTest::SetUp();
    if (!SlurmCluster::installed()) GTEST_SKIP() << "Slurm is not installed: scripts/packages farm";
    cluster_ = std::make_unique<SlurmCluster>(folder_ / "slurm");
  }
  void TearDown() override {
    for (const Task& task : tasks()) kill(task.pid, SIGKILL);  // orphans, which Slurm has forgotten
    if (HasFailure() && cluster_) GTEST_LOG_(INFO) << cluster_->logs() << job_logs();
    cluster_.reset();
    FarmTest::TearDown();
  }

  [[nodiscard]] ProcessResult submit(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words =
        program({"farm", "submit", work(), "--slurm", "--mem", "200M", "--cpus", "1", "--json"});
    words.insert(words.end(), more.begin(), more.end());
    return cluster_->run(words);
  }
  [[nodiscard]] bool wait_for_empty_queue() const {
    return wait_until([&] { return cluster_->queued() == 0; }, kLong);
  }
  [[nodiscard]] int chunks_done() const { return status().at("chunks_done").get<int>(); }
  [[nodiscard]] std::string job_logs() const {
    return run_process({"/bin/sh", "-c", "tail -n 20 \"$1\"/slurm/logs/*", "sh", work()}).out;
  }
  /// Makes chunks of some seconds, so that a node can be killed within one.
  void plan_long_chunks() {
    rig_ = source_file("scenes/rigs/paper-64.toml");
    plan("0:24", "2", kLongFlags);
  }
  static inline const std::vector<std::string> kLongFlags = {"--samples", "4"};

  /// Task is a process that renders a chunk of this film.
  struct Task {
    pid_t pid = 0;
    uint64_t chunk = 0;
    std::string node;
  };
  [[nodiscard]] std::vector<Task> tasks() const {
    std::vector<Task> found;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator("/proc", error)) {
      const std::string number = entry.path().filename().string();
      if (number.find_first_not_of("0123456789") != std::string::npos) continue;
      const std::vector<std::string> words = strings_of(entry.path() / "cmdline");
      if (words.size() < 5 || words[2] != "render" || words[3] != work()) continue;
      Task task{.pid = std::stoi(number), .chunk = std::stoull(words[4]), .node = {}};
      for (const std::string& variable : strings_of(entry.path() / "environ"))
        if (variable.starts_with("SLURMD_NODENAME=")) task.node = variable.substr(16);
      found.push_back(task);
    }
    return found;
  }
  /// Waits for a process on a node, and stops it.
  [[nodiscard]] std::optional<Task> stop_task_on(const std::string& node) const {
    std::optional<Task> stopped;
    (void)wait_until(
        [&] {
          for (const Task& task : tasks())
            if (task.node == node && kill(task.pid, SIGSTOP) == 0) stopped = task;
          return stopped.has_value();
        },
        std::chrono::seconds(120));
    return stopped;
  }

  std::unique_ptr<SlurmCluster> cluster_;

 private:
  /// Returns the strings of a file in which each ends with a zero.
  static std::vector<std::string> strings_of(const std::filesystem::path& file) {
    std::ifstream in(file);
    std::vector<std::string> strings;
    for (std::string text; std::getline(in, text, '\0');) strings.push_back(text);
    return strings;
  }
};

TEST_F(FarmSlurm, RendersAndMergesAFilmOnTwoNodes) {
  plan("0:60", "4");  // 15 chunks, in two arrays of at most 10 tasks
  const ProcessResult submitted = submit({"--array-limit", "4", "--partition", "farm"});
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const json jobs = json::parse(submitted.out);
  EXPECT_EQ(jobs.at("chunks_submitted"), 15);
  EXPECT_EQ(jobs.at("array_jobs").size(), 2U);
  ASSERT_TRUE(jobs.at("merge_job").is_number());
  // What is in the queue is not submitted twice.
  const ProcessResult again = submit();
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_LT(json::parse(again.out).at("chunks_submitted"), 4) << again.out;
  ASSERT_TRUE(wait_for_empty_queue());
  const json done = status();
  EXPECT_EQ(done.at("complete"), true) << done.dump(1);
  EXPECT_EQ(done.at("nodes").size(), 2U) << done.dump(1);
  EXPECT_EQ(film(), film_of_one_run("0:60"));
}

TEST_F(FarmSlurm, SubmitsOnlyWhatIsMissing) {
  plan("0:40", "4");
  for (const uint64_t chunk : {0U, 1U, 2U, 5U, 6U, 7U, 9U})
    ASSERT_EQ(render_chunk(chunk).exit_code, 0);
  const ProcessResult dry = submit({"--dry-run"});
  EXPECT_EQ(dry.exit_code, 0) << dry.err;
  EXPECT_NE(dry.out.find("--array=0-2"), std::string::npos) << dry.out;
  EXPECT_NE(dry.out.find("#SBATCH --requeue"), std::string::npos) << dry.out;
  EXPECT_EQ(cluster_->queued(), 0);
  const ProcessResult submitted = submit();
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_EQ(json::parse(submitted.out).at("chunks_submitted"), 3);
  ASSERT_TRUE(wait_for_empty_queue());
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

/// Slurm starts the task of a node that is marked down again, while the first process goes on.
TEST_F(FarmSlurm, AnOrphanThatEndsWhileItsSuccessorRunsDoesNoHarm) {
  rig_ = source_file("scenes/rigs/paper-64.toml");
  plan("0:8", "8", kLongFlags);  // one chunk
  ASSERT_EQ(submit().exit_code, 0);
  const auto is_running = [&] { return tasks().size() == 1 && !tasks()[0].node.empty(); };
  ASSERT_TRUE(wait_until(is_running, kLong));
  const std::string lost = tasks()[0].node;
  const std::string other = lost == "n1" ? "n2" : "n1";
  const auto orphan = stop_task_on(lost);
  ASSERT_TRUE(orphan);
  cluster_->kill_node(lost);
  ASSERT_EQ(cluster_
                ->run({"/usr/bin/scontrol", "update", "nodename=" + lost, "state=down",
                       "reason=killed by the test"})
                .exit_code,
            0);
  const auto successor = stop_task_on(other);
  ASSERT_TRUE(successor);
  EXPECT_EQ(chunks_done(), 0);
  kill(orphan->pid, SIGCONT);
  ASSERT_TRUE(wait_until([&] { return chunks_done() == 1; }, kLong));
  kill(successor->pid, SIGCONT);
  ASSERT_TRUE(wait_for_empty_queue());
  const json done = status();
  EXPECT_TRUE(done.at("differing").empty());
  EXPECT_EQ(done.at("chunks_failed"), 0);
  EXPECT_EQ(done.at("nodes").at(0).at("node"), lost) << "the first result stays";
  EXPECT_EQ(film(), film_of_one_run("0:8", kLongFlags));
}

/// The tasks of the killed node go on as orphans, and are started again on the other node: each
/// chunk of that node is rendered twice.
TEST_F(FarmSlurm, SurvivesANodeThatDiesAndAControllerThatRestarts) {
  plan_long_chunks();
  ASSERT_EQ(submit().exit_code, 0);
  ASSERT_TRUE(
      wait_until([&] { return cluster_->running_on("n2") > 0 && chunks_done() > 1; }, kLong));
  cluster_->kill_node("n2");
  ASSERT_EQ(cluster_
                ->run({"/usr/bin/scontrol", "update", "nodename=n2", "state=down",
                       "reason=killed by the test"})
                .exit_code,
            0);
  ASSERT_TRUE(wait_until([&] { return chunks_done() > 4; }, kLong));
  cluster_->kill_controller();
  ASSERT_TRUE(wait_until([&] { return tasks().empty(); }, kLong)) << "what runs goes on to its end";
  EXPECT_LT(chunks_done(), 12);
  cluster_->start_controller();
  cluster_->start_node("n2");
  ASSERT_TRUE(wait_until([&] { return cluster_->queued() > 0; }, std::chrono::seconds(60)));
  ASSERT_TRUE(wait_for_empty_queue());
  const json done = status();
  EXPECT_EQ(done.at("complete"), true) << done.dump(1);
  EXPECT_TRUE(done.at("differing").empty());
  // The merge has waited for the tasks that were started again.
  EXPECT_EQ(film(), film_of_one_run("0:24", kLongFlags));
}

TEST_F(FarmSlurm, AFailedChunkIsNamedByTheMergeAndSubmittedAgain) {
  plan("0:40", "4");
  std::filesystem::create_directory(work() + "/reports/000003.json");  // no file can be put there
  ASSERT_EQ(submit().exit_code, 0);
  ASSERT_TRUE(wait_until([&] { return chunks_done() == 9; }, kLong));
  ASSERT_EQ(cluster_->run({"/usr/bin/scancel", "--name=film-merge"}).exit_code, 0);
  ASSERT_TRUE(wait_for_empty_queue());
  EXPECT_EQ(status().at("chunks_failed"), 1);
  EXPECT_FALSE(std::filesystem::exists(path("film.lts")));
  std::filesystem::remove(work() + "/reports/000003.json");
  const ProcessResult submitted = submit();
  EXPECT_EQ(json::parse(submitted.out).at("chunks_submitted"), 1) << submitted.err;
  ASSERT_TRUE(wait_for_empty_queue());
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

}  // namespace
}  // namespace lenticule::test
