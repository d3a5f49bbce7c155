// SPDX-License-Identifier: Apache-2.0
// SlurmCluster runs Slurm with two nodes on this machine, as the user who runs the test: munged on
// a private socket, slurmctld, and two slurmd that think that they are different nodes.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace lenticule::test {

class SlurmCluster {
 public:
  /// Returns false if a program of Slurm or munge is not installed.
  [[nodiscard]] static bool installed();

  /// Starts everything in `folder`, and waits until both nodes are idle. Throws std::runtime_error
  /// with the logs.
  explicit SlurmCluster(std::filesystem::path folder);
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
  void kill_node(const std::string& name) { daemons_.erase(name); }

  /// Returns the number of tasks in the queue that are in `state`, or in any.
  [[nodiscard]] int queued(const std::string& state = "all") const;
  /// Returns the number of tasks that run on a node.
  [[nodiscard]] int running_on(const std::string& node) const;
  [[nodiscard]] std::string logs() const;

 private:
  void start(const std::string& name, const std::string& command);
  void write_configuration() const;

  std::filesystem::path folder_;
  std::map<std::string, std::unique_ptr<BackgroundProcess>> daemons_;
};

/// Waits until `condition` is true; returns false after the timeout.
[[nodiscard]] bool wait_until(const std::function<bool()>& condition, std::chrono::seconds timeout);

}  // namespace lenticule::test
