// SPDX-License-Identifier: Apache-2.0
// SlurmCluster runs Slurm with two nodes on this machine, as the user who runs the test: munged on
// a private socket, slurmctld, and two slurmd that think that they are different nodes.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/comes_true.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

class SlurmCluster {
 public:
  /// Returns false if a program of Slurm or munge is not installed.
  [[nodiscard]] static bool installed();

  /// Starts everything in a folder with a short name, since Slurm's sockets allow 108 characters,
  /// and waits until both nodes are idle. Throws std::runtime_error with the logs.
  /// `node_seconds` is the time after which a node that does not answer is lost. Slurm asks nodes
  /// in a third of it, and lets them list their tasks at every 20th question.
  explicit SlurmCluster(int node_seconds = 10);
  /// Cancels all jobs and kills the processes.
  ~SlurmCluster();
  SlurmCluster(const SlurmCluster&) = delete;
  SlurmCluster& operator=(const SlurmCluster&) = delete;

  /// Runs a program with the cluster's configuration.
  [[nodiscard]] ProcessResult run(const std::vector<std::string>& arguments) const;
  /// Returns the words that run a program with the cluster's configuration.
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& arguments) const;

  void start_controller();
  void start_node(const std::string& name);
  /// Kills the daemon; a task that it started goes on.
  void kill_controller() { daemons_.erase("slurmctld"); }
  /// Ends the controller as an administrator does: it writes down what it knows before.
  void stop_controller();
  void kill_node(const std::string& name) { daemons_.erase(name); }

  /// Returns the number of tasks in the queue that are in `state`, or in any.
  [[nodiscard]] int queued(const std::string& state = "all") const;
  /// Returns the number of tasks that run on a node.
  [[nodiscard]] int running_on(const std::string& node) const;
  /// Returns the queue and the nodes, with the reason of each state.
  [[nodiscard]] std::string overview() const;

  void set_down(const std::string& node) const;
  /// Lets nodes that Slurm has drained take tasks again.
  void resume_drained_nodes() const;
  /// While launches fail, Slurm holds the tasks and drains the nodes.
  void let_launches_fail(bool fail) const;

  [[nodiscard]] std::string logs() const;

 private:
  void start(const std::string& name, const std::string& command);
  void write_configuration() const;

  ScratchFolder scratch_;
  std::filesystem::path folder_;
  int node_seconds_;
  std::map<std::string, std::unique_ptr<BackgroundProcess>> daemons_;
};

/// The pause between two questions to Slurm.
inline constexpr std::chrono::milliseconds kPause{300};

}  // namespace lenticule::test
