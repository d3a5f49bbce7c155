// SPDX-License-Identifier: Apache-2.0
// Progress reports long work on standard error: a bar on a terminal, a line from time to time
// elsewhere.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "base/print.h"

namespace lenticule::player {

/// Redraws at most ten times a second on a terminal, every five seconds elsewhere. Thread safety:
/// one thread.
class Progress {
 public:
  /// `unit` is the plural of the counted unit: "frames".
  Progress(std::string label, std::string unit, uint64_t total, bool is_quiet = false)
      : label_(std::move(label)),
        unit_(std::move(unit)),
        total_(total),
        is_quiet_(is_quiet),
        terminal_(!is_quiet && stderr_is_terminal()),
        start_(Clock::now()),
        last_draw_(start_) {}
  ~Progress() {
    if (!finished_ && drawn_ && terminal_) say("\n");
  }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `skipped` of the units were done before, and took no time.
  void update(uint64_t done, const std::string& note = {}, uint64_t skipped = 0) {
    done_ = done;
    skipped_ = skipped;
    note_ = note;
    const auto now = Clock::now();
    const bool due = now - last_draw_ >= (terminal_ ? Clock::duration(kTerminalInterval)
                                                    : Clock::duration(kLogInterval));
    if (!due) return;
    last_draw_ = now;
    draw(false);
  }
  /// Draws the final state and ends the line.
  void finish(const std::string& note = {}) {
    if (finished_) return;
    finished_ = true;
    note_ = note;
    draw(true);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr auto kTerminalInterval = std::chrono::milliseconds(100);
  static constexpr auto kLogInterval = std::chrono::seconds(5);
  static constexpr int kBarWidth = 28;

  static bool stderr_is_terminal() {
    const char* term = std::getenv("TERM");
    return isatty(STDERR_FILENO) == 1 && term != nullptr && std::strcmp(term, "dumb") != 0;
  }

  static std::string format_seconds(double seconds) {
    const auto whole = static_cast<long>(seconds + 0.5);
    if (whole < 60) return fmt::format("{}s", whole);
    if (whole < 3600) return fmt::format("{}m{:02}s", whole / 60, whole % 60);
    return fmt::format("{}h{:02}m", whole / 3600, whole % 3600 / 60);
  }
  void draw(bool final) {
    if (is_quiet_) return;
    drawn_ = true;
    const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
    const double rate = elapsed > 0 ? static_cast<double>(done_ - skipped_) / elapsed : 0.0;
    const double remaining =
        rate > 0 && total_ > done_ ? static_cast<double>(total_ - done_) / rate : 0.0;

    const std::string count = total_ > 0 ? fmt::format("{}/{} {}", done_, total_, unit_)
                                         : fmt::format("{} {}", done_, unit_);
    const std::string when =
        final ? fmt::format("in {}", format_seconds(elapsed))
              : (remaining > 0 ? fmt::format("{} left", format_seconds(remaining)) : std::string());
    const std::string tail = note_.empty() ? when : fmt::format("{}  {}", when, note_);
    if (!terminal_) {
      say("{}: {}, {:.2f}/s, {}\n", label_, count, rate, tail);
      return;
    }
    std::string bar;
    if (total_ > 0) {
      const auto filled = static_cast<size_t>(
          kBarWidth * std::min(1.0, static_cast<double>(done_) / static_cast<double>(total_)));
      bar = fmt::format("[{}{}] ", std::string(filled, '#'), std::string(kBarWidth - filled, ' '));
    }
    say("\r\033[K{} {}{}  {:.2f}/s  {}", label_, bar, count, rate, tail);
    if (final) say("\n");
  }

  std::string label_;
  std::string unit_;
  uint64_t total_;
  uint64_t done_ = 0, skipped_ = 0;
  std::string note_;
  bool is_quiet_;
  bool terminal_ = false;
  bool finished_ = false;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace lenticule::player
