// SPDX-License-Identifier: Apache-2.0
// Progress reports long work on standard error: a bar on a terminal, a line from time to time
// elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace lenticule::player {

enum class ProgressStyle { Auto, Json, Off };

/// Redraws at most ten times a second on a terminal, every five seconds elsewhere. Thread safety:
/// one thread.
class Progress {
 public:
  /// `unit` is the plural of the counted unit: "frames".
  Progress(std::string label, std::string unit, uint64_t total,
           ProgressStyle style = ProgressStyle::Auto);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(uint64_t done, const std::string& note = {});
  /// Draws the final state and ends the line.
  void finish(const std::string& note = {});

 private:
  void draw(bool final);

  std::string label_;
  std::string unit_;
  uint64_t total_;
  uint64_t done_ = 0;
  std::string note_;
  ProgressStyle style_;
  bool terminal_ = false;
  bool finished_ = false;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace lenticule::player
