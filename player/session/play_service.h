// SPDX-License-Identifier: Apache-2.0
// PlayService reports a playback to systemd: ready with the first frame, a status line for people,
// watchdog pings only while frames are displayed, and the active output kept for the next player.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "base/numbers.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "display/kms/scanout/kms_display.h"
#include "player/playback/play_statistics.h"

namespace lenticule::player {

/// A descriptor that the previous process stored.
struct StoredDescriptor {
  std::string name;
  UniqueFd fd;
};

/// ServiceManager talks to systemd: notifications, watchdog, and the fd store that keeps
/// descriptors for the next process. No function throws if the manager does not respond: a player
/// also plays without one. Thread safety: one thread at a time.
class ServiceManager {
 public:
  /// Finds the manager by the environment ($NOTIFY_SOCKET, $WATCHDOG_USEC).
  ServiceManager();

  /// Returns false if this process is not a service; all functions below then do nothing.
  [[nodiscard]] bool present() const noexcept { return present_; }
  /// Returns the longest time between two pings; none = no watchdog.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const noexcept {
    return watchdog_;
  }

  // A message consists of lines KEY=value. Escaping keeps a text from adding a line.
  void status(const std::string& text) const noexcept { notify("STATUS=" + escaped(text)); }
  void ready(const std::string& text) const noexcept { notify("READY=1\nSTATUS=" + escaped(text)); }
  void stopping(const std::string& text) const noexcept {
    notify("STOPPING=1\nSTATUS=" + escaped(text));
  }
  void ping() const noexcept { notify("WATCHDOG=1"); }

  /// Stores a copy of `fd` until the service is stopped, replacing the one of that name.
  void keep(const std::string& name, int fd) const noexcept;
  void forget(const std::string& name) const noexcept;

 private:
  void notify(const std::string& text) const noexcept;

  bool present_ = false;
  std::optional<std::chrono::microseconds> watchdog_;
};

/// Takes the descriptors that the manager passed to this process. Works once, because it clears
/// them from the environment.
[[nodiscard]] std::vector<StoredDescriptor> take_stored_descriptors();

/// Older starts are forgotten. Long enough for five starts that a watchdog ended.
inline constexpr std::chrono::seconds kStartsRemembered{120};

/// StartHistory counts the recent starts of a service that did not end well. A player that keeps
/// dying then starts in safe mode.
/// Stores the starts in a small file, in a folder that outlives the process and not the machine's
/// boot. A folder that cannot be written does not prevent a start; the history is then empty.
/// Thread safety: one thread.
class StartHistory {
 public:
  /// Records this start at once, so that a start that crashes is included. `folder` empty = no
  /// history. `now` is from a clock that continues over restarts of the process.
  StartHistory(const std::filesystem::path& folder, std::chrono::seconds now)
      : file_(folder.empty() ? folder : folder / kFileName), this_{.at = now, .reason = {}} {
    if (file_.empty()) return;
    try {
      read(now);
    } catch (const std::exception&) {
      before_.clear();  // no file yet, or not readable
    }
    failed({});
  }

  /// Returns the number of starts before this one that did not end well.
  [[nodiscard]] int failures() const { return static_cast<int>(before_.size()); }
  /// Returns the reason that the last of them recorded; empty if it could not record one.
  [[nodiscard]] std::string last_reason() const {
    return before_.empty() ? std::string() : before_.back().reason;
  }

  /// Removes this start from the history.
  void ended_well() noexcept { write(before_); }
  void failed(const std::string& reason) noexcept {
    try {
      this_.reason = one_line(reason);
      std::vector<Start> starts = before_;
      starts.push_back(this_);
      write(starts);
    } catch (const std::exception&) {
      return;  // no memory to record the reason
    }
  }

 private:
  static constexpr const char* kFileName = "starts";
  static constexpr uint64_t kMaxFileBytes = 64 * 1024;
  static constexpr size_t kMaxReasonBytes = 400;
  static constexpr size_t kMaxStarts = 100;

  static std::string one_line(std::string_view text) {
    std::string line(text.substr(0, kMaxReasonBytes));
    std::replace_if(
        line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    return line;
  }
  struct Start {
    std::chrono::seconds at{0};
    std::string reason;
  };

  /// Parses "SECONDS REASON" per line; skips lines that are malformed, too old or in the future.
  void read(std::chrono::seconds now) {
    const std::vector<uint8_t> bytes = read_whole_file(file_, kMaxFileBytes);
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    while (!text.empty() && before_.size() < kMaxStarts) {
      std::string_view reason = take_until(text, '\n');
      const auto at = take_number<int64_t>(reason);
      const std::chrono::seconds when(at.value_or(0));
      if (!at || when > now || when < now - kStartsRemembered) continue;
      reason.remove_prefix(std::min(reason.find_first_not_of(' '), reason.size()));
      before_.push_back({when, one_line(reason)});
    }
  }
  void write(const std::vector<Start>& starts) const noexcept {
    if (file_.empty()) return;
    try {
      std::string text;
      for (const Start& start : starts)
        text += fmt::format("{} {}\n", start.at.count(), start.reason);
      write_file_atomically(file_,
                            std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
    } catch (const std::exception&) {
      return;  // a full or read-only disk must not prevent playing
    }
  }

  std::filesystem::path file_;  ///< empty = no history
  std::vector<Start> before_;
  Start this_;
};

/// Returns the time since the machine was started, including time suspended.
[[nodiscard]] std::chrono::seconds time_since_boot();

/// Stores the active output in the service manager's fd store, a descriptor of the card and the
/// state that a successor needs: the last frame of a player that dies stays displayed, and the next
/// player continues in the same buffers.
void store_output(const ServiceManager& manager, const display::KmsDisplay& display);
void forget_output(const ServiceManager& manager);

/// Returns the output that a previous player left; null if there is none or its state is not valid.
/// Closes the other descriptors.
[[nodiscard]] std::shared_ptr<display::PreviousOutput> stored_output(
    std::vector<StoredDescriptor> descriptors);

/// Monotonic counts of a running playback.
struct ProgressSample {
  uint64_t flips = 0;       ///< frames that were displayed
  uint64_t vblanks = 0;     ///< events of the display that the presenter handled
  uint64_t failures = 0;    ///< flips that were refused or never reported
  bool panel_away = false;  ///< switched off or unplugged: no frame would be visible
  bool stalled = false;     ///< a due frame does not come, for a reason in this process
};

/// Returns the stage of the playback that has not done what was due for two seconds; empty if none.
[[nodiscard]] inline std::string stalled_stage(const StageDelays& delays) {
  constexpr double kStalledS = 2.0;
  if (delays.presenter >= kStalledS) return "the presenter stands still";
  if (delays.display >= kStalledS) return "the display reports no vblank";
  if (delays.frame_copier >= kStalledS) return "the frame copier stands still";
  if (delays.source >= kStalledS) return "no frame arrives";
  return {};
}

/// Watchdog decides whether to ping the systemd watchdog: yes if frames are displayed or none are
/// due; no if flips fail, the display clock has stopped, or a due frame does not come.
/// Thread safety: one thread.
class Watchdog {
 public:
  /// Returns true if a frame was displayed since the last call, or if none was due: the source has
  /// no new frame, another session is in front, or the panel is away. Returns false if the
  /// display's flips keep failing, its clock stands still, or the playback is stalled.
  [[nodiscard]] bool should_ping(const ProgressSample& now) noexcept {
    const bool shown = now.flips != last_.flips;
    const bool idle =
        now.vblanks != last_.vblanks && now.failures == last_.failures && !now.stalled;
    last_ = now;
    return shown || idle || now.panel_away;
  }

 private:
  ProgressSample last_;
};

[[nodiscard]] ProgressSample progress_sample(const PlayReport& report,
                                             const display::KmsStatistics* kms);

/// Returns "EXACT yes; 600 frames shown, 0 underruns, 0 missed vblanks, panel showing; DP-1 on
/// ...".
[[nodiscard]] std::string status_text(const PlayReport& report, const display::KmsStatistics* kms,
                                      const display::ExactnessReport* exactness);

/// Does nothing if there is no service manager. Thread safety: one thread.
class PlayService {
 public:
  /// `display` is null unless it is a KMS display. Lifetime: it must stay valid until the last
  /// report.
  PlayService(const ServiceManager& manager, const display::KmsDisplay* display)
      : manager_(manager), display_(display), last_ping_(std::chrono::steady_clock::now()) {
    store_again();
  }

  /// Call about once a second while playing.
  void report(const PlayReport& report) {
    if (!manager_.present()) return;
    std::optional<display::KmsStatistics> kms;
    std::optional<display::ExactnessReport> exactness;
    if (display_ != nullptr) {
      kms = display_->statistics();
      exactness = display_->exactness();
    }
    const display::KmsStatistics* const statistics = kms ? &*kms : nullptr;
    std::string text = status_text(report, statistics, exactness ? &*exactness : nullptr);
    if (!problem_.empty()) text = "test card shown: " + problem_ + "; " + text;
    if (!warning_.empty()) text += "; " + warning_;
    if (!ready_ && report.first_frame_ms > 0) {
      ready_ = true;
      manager_.ready(text);
    } else if (ready_) {
      manager_.status(text);
    }

    if (!manager_.watchdog()) return;
    // Often enough for the watchdog, and rarely enough that a failing display is noticed between
    // two pings.
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ping_ < *manager_.watchdog() * 2 / 5) return;
    last_ping_ = now;
    if (watchdog_.should_ping(progress_sample(report, statistics))) manager_.ping();
  }
  /// Stores the output again after the display came back.
  void store_again() {
    if (display_ != nullptr) store_output(manager_, *display_);
  }
  /// Sets an error that replaces normal playback, for the status line; empty = none.
  void set_problem(const std::string& problem) { problem_ = problem; }
  /// Sets a warning that does not affect the picture, for the end of the status line; empty = none.
  void set_warning(const std::string& warning) { warning_ = warning; }

 private:
  const ServiceManager& manager_;
  const display::KmsDisplay* display_;
  Watchdog watchdog_;
  bool ready_ = false;
  std::string problem_;
  std::string warning_;
  std::chrono::steady_clock::time_point last_ping_;
};

}  // namespace lenticule::player
