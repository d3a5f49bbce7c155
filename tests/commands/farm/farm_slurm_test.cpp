// SPDX-License-Identifier: Apache-2.0
// Tests the farm with a real Slurm of two nodes on this machine.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>

#include "farm_fixture.h"
#include "slurm_cluster.h"

namespace lenticule::test {
namespace {

constexpr std::chrono::seconds kStill{90};     ///< longest time in which nothing changes
constexpr std::chrono::seconds kLongest{300};  ///< longest time for anything

class FarmSlurm : public FarmTest {
 protected:
  void SetUp() override {
    if (!SlurmCluster::installed()) GTEST_SKIP() << "Slurm is not installed: scripts/packages farm";
    cluster_ = std::make_unique<SlurmCluster>(node_seconds_);
  }
  void TearDown() override {
    for (const Task& task : tasks()) kill(task.pid, SIGKILL);  // orphans, which Slurm has forgotten
    if (HasFailure() && cluster_) GTEST_LOG_(INFO) << cluster_->logs() << job_logs();
    cluster_.reset();
  }

  [[nodiscard]] ProcessResult submit(const std::vector<std::string>& more = {}) const {
    return cluster_->run(joined(submission(), more));
  }
  /// Submits as a user to whom Slurm refuses the release of tasks.
  [[nodiscard]] ProcessResult submit_without_right_to_release() const {
    const std::string folder = path("refusing");
    std::filesystem::create_directories(folder);
    std::ofstream(folder + "/scontrol")
        << "#!/bin/sh\n[ \"$1\" != release ] && exec /usr/bin/scontrol \"$@\"\n"
           "echo 'Access/permission denied for job' \"$2\" >&2; exit 1\n";
    std::filesystem::permissions(folder + "/scontrol", std::filesystem::perms::owner_all);
    std::vector<std::string> words = submission();
    words.insert(words.begin(), {"/usr/bin/env", "PATH=" + folder + ":/usr/bin:/bin"});
    return cluster_->run(words);
  }
  [[nodiscard]] std::vector<std::string> submission() const {
    return program({"farm", "submit", work(), "--slurm", "--mem", "200M", "--cpus", "1", "--json"});
  }
  /// Returns the status as a user of the cluster sees it.
  [[nodiscard]] json status() const {
    const ProcessResult result = cluster_->run(program({"farm", "status", work(), "--json"}));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out, nullptr, false);
  }
  /// Waits as long as something changes: queue, nodes, or what processes of chunks report, which
  /// they do every 20 s. A failure says for what it waited, and why tasks wait.
  [[nodiscard]] testing::AssertionResult comes(const std::string& what,
                                               const std::function<bool()>& condition) const {
    const auto begin = std::chrono::steady_clock::now();
    auto changed = begin;
    std::string last;
    while (true) {
      if (comes_true(condition, kPause, std::chrono::seconds(2)))
        return testing::AssertionSuccess();
      const auto now = std::chrono::steady_clock::now();
      if (const std::string state = cluster_->overview() + progress_texts(); state != last) {
        last = state;
        changed = now;
      }
      if (now - changed > kStill || now - begin > kLongest)
        return testing::AssertionFailure() << "waited in vain for: " << what << "\n" << last;
    }
  }
  [[nodiscard]] testing::AssertionResult queue_becomes_empty() const {
    return comes("an empty queue", [&] { return cluster_->queued() == 0; });
  }
  /// Does what a user does until the film is there: looks at the status, and submits again what
  /// Slurm holds or has lost. The administrator lets drained nodes work again.
  [[nodiscard]] testing::AssertionResult user_gets_the_film() {
    return comes("a merged film", [&] {
      const json now = status();
      if (now.at("complete") == true && now.at("merged") == true) return cluster_->queued() == 0;
      const json& slurm = now.at("slurm");
      if (slurm.contains("error")) return false;  // the controller starts
      const bool is_lost = slurm.at("running") == 0 && slurm.at("waiting") == 0;
      if (slurm.at("held").empty() && !is_lost) return false;
      cluster_->resume_drained_nodes();
      const ProcessResult again = submit();
      if (again.exit_code == 0) released_ += json::parse(again.out).at("tasks_released").get<int>();
      return false;
    });
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
  /// Kills the daemon of n2 while chunks run there and others wait.
  void start_long_film_and_kill_a_node() {
    plan_long_chunks();
    ASSERT_EQ(submit().exit_code, 0);
    ASSERT_TRUE(comes("tasks on n2, and two chunks",
                      [&] { return cluster_->running_on("n2") > 0 && chunks_done() > 1; }));
    cluster_->kill_node("n2");
    cluster_->set_down("n2");
    ASSERT_TRUE(comes("five chunks", [&] { return chunks_done() > 4; }));
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
    EXPECT_TRUE(comes("a task on " + node, [&] {
      for (const Task& task : tasks())
        if (!stopped && task.node == node && kill(task.pid, SIGSTOP) == 0) stopped = task;
      return stopped.has_value();
    }));
    return stopped;
  }

  std::unique_ptr<SlurmCluster> cluster_;
  int node_seconds_ = 10;
  int released_ = 0;  ///< tasks that Slurm held

 private:
  /// Returns what the processes of chunks report, and which chunks are done.
  [[nodiscard]] std::string progress_texts() const {
    return run_process({"/bin/sh", "-c",
                        "cd \"$1\" && ls reports && cat attempts/*/.*/progress.json 2>&1", "sh",
                        work()})
        .out;
  }
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
  EXPECT_LT(results_of(submit()).at("chunks_submitted"), 4);
  ASSERT_TRUE(queue_becomes_empty());
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
  EXPECT_EQ(results_of(submit()).at("chunks_submitted"), 3);
  ASSERT_TRUE(queue_becomes_empty());
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

/// Slurm starts the task of a node that is marked down again, while the first process goes on.
TEST_F(FarmSlurm, AnOrphanThatEndsWhileItsSuccessorRunsDoesNoHarm) {
  rig_ = source_file("scenes/rigs/paper-64.toml");
  plan("0:4", "4", kLongFlags);  // one chunk
  ASSERT_EQ(submit().exit_code, 0);
  const auto is_running = [&] { return tasks().size() == 1 && !tasks()[0].node.empty(); };
  ASSERT_TRUE(comes("a running task", is_running));
  const std::string lost = tasks()[0].node;
  const std::string other = lost == "n1" ? "n2" : "n1";
  const auto orphan = stop_task_on(lost);
  ASSERT_TRUE(orphan);
  cluster_->kill_node(lost);
  cluster_->set_down(lost);
  const auto successor = stop_task_on(other);
  ASSERT_TRUE(successor);
  EXPECT_EQ(chunks_done(), 0);
  kill(orphan->pid, SIGCONT);
  ASSERT_TRUE(comes("a chunk", [&] { return chunks_done() == 1; }));
  kill(successor->pid, SIGCONT);
  ASSERT_TRUE(queue_becomes_empty());
  const json done = status();
  EXPECT_TRUE(done.at("differing").empty());
  EXPECT_EQ(done.at("chunks_failed"), 0);
  EXPECT_EQ(done.at("nodes").at(0).at("node"), lost) << "the first result stays";
  EXPECT_EQ(film(), film_of_one_run("0:4", kLongFlags));
}

/// A controller that was started again asks nodes for their tasks after 20 questions.
class FarmSlurmRestart : public FarmSlurm {
 protected:
  FarmSlurmRestart() { node_seconds_ = 5; }
};

/// The tasks of the killed node go on as orphans, and are started again on the other node: each
/// chunk of that node is rendered twice.
TEST_F(FarmSlurmRestart, SurvivesANodeThatDiesAndAControllerThatRestarts) {
  start_long_film_and_kill_a_node();
  cluster_->stop_controller();
  ASSERT_TRUE(comes("the end of running tasks", [&] { return tasks().empty(); }));
  EXPECT_EQ(status().at("slurm").count("error"), 1U) << "the files say how far the farm is";
  EXPECT_LT(chunks_done(), 12);
  cluster_->start_controller();
  cluster_->start_node("n2");
  ASSERT_TRUE(user_gets_the_film());
  EXPECT_TRUE(status().at("differing").empty());
  // The merge has waited for the tasks that were started again.
  EXPECT_EQ(film(), film_of_one_run("0:24", kLongFlags));
}

/// A controller that is killed forgets the last seconds. It starts tasks again that run or have
/// ended; a node that knows such a task refuses it, and Slurm then holds the task for ever and
/// drains the node.
TEST_F(FarmSlurmRestart, TheFilmIsCompleteAfterTheControllerForgotItsLastSeconds) {
  start_long_film_and_kill_a_node();
  cluster_->kill_controller();
  ASSERT_TRUE(comes("the end of running tasks", [&] { return tasks().empty(); }));
  cluster_->start_controller();
  cluster_->start_node("n2");
  ASSERT_TRUE(user_gets_the_film());
  GTEST_LOG_(INFO) << released_ << " tasks were held";
  EXPECT_TRUE(status().at("differing").empty());
  EXPECT_EQ(film(), film_of_one_run("0:24", kLongFlags));
}

TEST_F(FarmSlurm, StatusNamesTasksThatSlurmHoldsAndSubmitReleasesThem) {
  plan("0:16", "4");
  cluster_->let_launches_fail(true);
  ASSERT_EQ(submit().exit_code, 0);
  ASSERT_TRUE(comes("held tasks", [&] { return !status().at("slurm").at("held").empty(); }));
  const ProcessResult shown = cluster_->run(program({"farm", "status", work()}));
  EXPECT_NE(shown.out.find("held by Slurm: chunks "), std::string::npos) << shown.out;
  EXPECT_NE(shown.out.find("farm submit " + work() + " --slurm releases"), std::string::npos)
      << shown.out;
  cluster_->let_launches_fail(false);
  cluster_->resume_drained_nodes();
  const ProcessResult again = submit();
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(json::parse(again.out).at("chunks_submitted"), 0) << again.out;
  EXPECT_GE(json::parse(again.out).at("tasks_released"), 1) << again.out;
  ASSERT_TRUE(user_gets_the_film());
  EXPECT_EQ(film(), film_of_one_run("0:16"));
}

TEST_F(FarmSlurm, SubmitCancelsHeldTasksThatTheUserMayNotReleaseAndSubmitsTheirChunksAgain) {
  plan("0:16", "4");
  cluster_->let_launches_fail(true);
  ASSERT_EQ(submit().exit_code, 0);
  ASSERT_TRUE(comes("held tasks", [&] { return !status().at("slurm").at("held").empty(); }));
  cluster_->let_launches_fail(false);
  cluster_->resume_drained_nodes();
  const ProcessResult again = submit_without_right_to_release();
  expect_end(again, 0, "permission denied");
  const json report = json::parse(again.out);
  EXPECT_EQ(report.at("tasks_released"), 0) << again.out;
  EXPECT_GE(report.at("tasks_cancelled"), 1) << again.out;
  EXPECT_EQ(report.at("chunks_submitted"), report.at("tasks_cancelled")) << again.out;
  ASSERT_TRUE(user_gets_the_film());
  EXPECT_EQ(film(), film_of_one_run("0:16"));
}

TEST_F(FarmSlurm, AFailedChunkIsNamedByTheMergeAndSubmittedAgain) {
  plan("0:40", "4");
  std::filesystem::create_directory(work() + "/reports/000003.json");  // no file can be put there
  ASSERT_EQ(submit().exit_code, 0);
  ASSERT_TRUE(comes("9 chunks", [&] { return chunks_done() == 9; }));
  ASSERT_EQ(cluster_->run({"/usr/bin/scancel", "--name=film-merge"}).exit_code, 0);
  ASSERT_TRUE(queue_becomes_empty());
  EXPECT_EQ(status().at("chunks_failed"), 1);
  EXPECT_FALSE(std::filesystem::exists(path("film.lts")));
  std::filesystem::remove(work() + "/reports/000003.json");
  EXPECT_EQ(results_of(submit()).at("chunks_submitted"), 1);
  ASSERT_TRUE(queue_becomes_empty());
  EXPECT_EQ(film(), film_of_one_run("0:40"));
}

}  // namespace
}  // namespace lenticule::test
