// SPDX-License-Identifier: Apache-2.0
// How often a service was started lately without ending well: a player that dies again and again
// has to start more carefully.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace lenticule::player {

/// Starts further back than that are forgotten: long enough for five that a watchdog ended.
inline constexpr std::chrono::seconds kStartsRemembered{120};

/// A small file in a folder that outlives the process but not the machine's run. A folder that
/// cannot be written is no reason not to start: then nothing is remembered. One thread.
class StartHistory {
 public:
  /// Notes this start at once, so that one that ends in a crash is in it. `folder` empty = nothing
  /// is remembered. `now` is of a clock that goes on over restarts.
  StartHistory(const std::filesystem::path& folder, std::chrono::seconds now);

  /// Starts before this one that did not end well.
  [[nodiscard]] int failures() const { return static_cast<int>(before_.size()); }
  /// What the last of them said; empty if it could not say anything.
  [[nodiscard]] std::string last_reason() const;

  /// This start is not counted.
  void ended_well() noexcept;
  void failed(const std::string& reason) noexcept;

 private:
  struct Start {
    std::chrono::seconds at{0};
    std::string reason;
  };

  void read(std::chrono::seconds now);
  void write(const std::vector<Start>& starts) const noexcept;

  std::filesystem::path file_;  ///< empty = remember nothing
  std::vector<Start> before_;
  Start this_;
};

/// Since the machine was started, suspended or not.
[[nodiscard]] std::chrono::seconds time_since_boot();

}  // namespace lenticule::player
