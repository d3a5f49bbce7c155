// SPDX-License-Identifier: Apache-2.0
// StepLink connects a player to its group: it exchanges messages on a thread of its own, and gives
// the timeline to the player's StepPacing.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "base/wake_fd.h"
#include "player/step/step_clock.h"
#include "player/step/step_member.h"
#include "player/step/step_pacing.h"
#include "player/step/step_socket.h"

namespace lenticule::player {

/// The flags of `lenticule play` that begin with --step, checked.
struct StepOptions {
  std::string group;
  bool leader = false;
  StepAddress address;
  std::vector<uint8_t> key;
};

/// Returns the bytes of a key file. Throws Error(Input) if it has less than 32 bytes, or if other
/// users can read it.
[[nodiscard]] std::vector<uint8_t> read_step_key(const std::string& file);

class StepLink {
 public:
  /// Opens the socket and begins to listen. Throws as StepSocket does.
  explicit StepLink(const StepOptions& options);
  ~StepLink();
  StepLink(const StepLink&) = delete;
  StepLink& operator=(const StepLink&) = delete;

  /// Returns the pacing that the presenter asks.
  [[nodiscard]] StepPacing& pacing() noexcept { return pacing_; }
  /// Returns the figures for the statistics. Thread safety: any thread.
  [[nodiscard]] nlohmann::ordered_json statistics() const;
  /// Prints what hinders the group, once per change. Thread safety: one thread.
  void report_trouble();

 private:
  /// Status holds the figures of the thread that the statistics print.
  struct Status {
    StepMessageCounts counts;
    uint64_t sent = 0;
    size_t peers = 0;
    int64_t apart = 0;
    int64_t largest_apart = 0;
    uint64_t clock_steps = 0;
    std::chrono::nanoseconds ahead_of_monotonic{0};
    ClockAccuracy accuracy;
    std::string trouble;
    std::string remedy;
  };

  void run() noexcept;
  void receive_waiting(const StepNow& now);
  void tick(const StepNow& now);
  void update_status(const StepPlace& place, const StepNow& now);
  void find_trouble(const StepPlace& place, const StepNow& now, Status& status) const;
  [[nodiscard]] Status status() const;

  const StepOptions options_;
  StepSocket socket_;
  StepPacing pacing_;
  StepClock clock_;
  std::unique_ptr<StepMember> member_;
  StepLeader* leader_ = nullptr;                ///< member_, if it is the leader
  std::map<uint64_t, StepEndpoint> endpoints_;  ///< address of each follower, by session
  std::chrono::nanoseconds untimely_until_{0};  ///< end of the time in which that is reported

  mutable std::mutex mutex_;  ///< guards status_
  Status status_;
  std::string reported_;  ///< remedy of the trouble that was printed last

  WakeFd wake_{"step"};
  std::atomic<bool> stopping_{false};
  std::thread thread_;  ///< last member: ends before the others are destroyed
};

}  // namespace lenticule::player
