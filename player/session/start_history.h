// SPDX-License-Identifier: Apache-2.0
// StartHistory counts the recent starts of a service that did not end well. A player that keeps
// dying then starts in safe mode.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::player {

/// Older starts are forgotten. Long enough for five starts that a watchdog ended.
inline constexpr std::chrono::seconds kStartsRemembered{120};

/// Stores the starts in a small file, in a folder that outlives the process and not the machine's
/// boot. A folder that cannot be written does not prevent a start; the history is then empty.
/// Thread safety: one thread.
class StartHistory {
 public:
  /// Records this start at once, so that a start that crashes is included. `folder` empty = no
  /// history. `now` is from a clock that continues over restarts of the process.
  StartHistory(const std::filesystem::path& folder, std::chrono::seconds now);

  /// Returns the number of starts before this one that did not end well.
  [[nodiscard]] int failures() const { return static_cast<int>(before_.size()); }
  /// Returns the reason that the last of them recorded; empty if it could not record one.
  [[nodiscard]] std::string last_reason() const;

  /// Removes this start from the history.
  void ended_well() noexcept;
  void failed(const std::string& reason) noexcept;

 private:
  struct Start {
    std::chrono::seconds at{0};
    std::string reason;
  };

  void read(std::chrono::seconds now);
  void write(const std::vector<Start>& starts) const noexcept;

  std::filesystem::path file_;  ///< empty = no history
  std::vector<Start> before_;
  Start this_;
};

/// Returns the time since the machine was started, including time suspended.
[[nodiscard]] std::chrono::seconds time_since_boot();

}  // namespace lenticule::player
