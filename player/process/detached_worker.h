// SPDX-License-Identifier: Apache-2.0
// DetachedWorker runs jobs one after the other on a thread of its own, for calls that may hang: a
// disk, the journal. A hanging job does not prevent the program from ending.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>

namespace lenticule::player {

/// Thread safety: one thread. Lifetime: jobs own what they use, because a hanging job outlives the
/// worker.
class DetachedWorker {
 public:
  using Job = std::function<void(const std::atomic<bool>& ending)>;

  /// Keeps at most `most_jobs`. A `background` worker gets only processor time and disk time that
  /// other threads leave.
  explicit DetachedWorker(size_t most_jobs, bool background = false);
  /// Tells the running job to end, and drops jobs that have not begun.
  ~DetachedWorker();
  DetachedWorker(const DetachedWorker&) = delete;
  DetachedWorker& operator=(const DetachedWorker&) = delete;

  /// Returns at once; false if too many jobs wait. The job must not throw.
  [[nodiscard]] bool post(Job job);
  /// Waits until all jobs are done; returns false if that takes longer than `timeout`.
  [[nodiscard]] bool wait(std::chrono::milliseconds timeout);

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace lenticule::player
