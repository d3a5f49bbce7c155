// SPDX-License-Identifier: Apache-2.0
// PlayService reports a playback to systemd: ready with the first frame, a status line for people,
// watchdog pings only while frames are displayed, and the active output kept for the next player.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
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
  ServiceManager() {
    const char* const socket = std::getenv("NOTIFY_SOCKET");
    present_ = socket != nullptr && *socket != '\0';
    uint64_t microseconds = 0;
    if (present_ && sd_watchdog_enabled(0, &microseconds) > 0)
      watchdog_ = std::chrono::microseconds(microseconds);
  }

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
  void keep(const std::string& name, int fd) const noexcept {
    forget(name);  // the manager would keep both
    const std::string text = fmt::format("FDSTORE=1\nFDNAME={}", name);
    if (present_) (void)sd_pid_notify_with_fds(0, 0, text.c_str(), &fd, 1);
  }
  void forget(const std::string& name) const noexcept {
    notify(fmt::format("FDSTOREREMOVE=1\nFDNAME={}", name));
  }

 private:
  void notify(const std::string& text) const noexcept {
    if (present_) (void)sd_notify(0, text.c_str());
  }

  bool present_ = false;
  std::optional<std::chrono::microseconds> watchdog_;
};

/// Takes the descriptors that the manager passed to this process. Works once, because it clears
/// them from the environment.
[[nodiscard]] inline std::vector<StoredDescriptor> take_stored_descriptors() {
  char** names = nullptr;
  const int count = sd_listen_fds_with_names(1, &names);
  std::vector<StoredDescriptor> kept;
  for (int i = 0; i < count; ++i) {
    kept.push_back({names[i], UniqueFd(SD_LISTEN_FDS_START + i)});
    std::free(names[i]);
  }
  std::free(names);
  return kept;
}

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
[[nodiscard]] inline std::chrono::seconds time_since_boot() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::chrono::seconds(time.tv_sec);
}

inline constexpr const char* kCardName = "lenticule-card";
inline constexpr const char* kStateName = "lenticule-output";

inline void forget_output(const ServiceManager& manager) {
  manager.forget(kCardName);
  manager.forget(kStateName);
}

/// Creates the state file, sealed, so that the successor uses exactly the bytes that it has
/// checked. Empty on failure.
inline UniqueFd state_file(const display::TakeoverState& state) {
  UniqueFd file(memfd_create(kStateName, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!file) return {};
  const auto bytes = display::bytes_of(state);
  if (write(file.get(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
    return {};
  if (fcntl(file.get(), F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) != 0)
    return {};
  return file;
}

/// Stores the active output in the service manager's fd store, a descriptor of the card and the
/// state that a successor needs: the last frame of a player that dies stays displayed, and the next
/// player continues in the same buffers.
inline void store_output(const ServiceManager& manager, const display::KmsDisplay& display) {
  if (!manager.present()) return;
  const UniqueFd state = state_file(display.takeover_state());
  if (!state) return forget_output(manager);
  manager.keep(kCardName, display.card_fd());
  manager.keep(kStateName, state.get());
}

inline std::optional<display::TakeoverState> read_state(int file) {
  // One extra byte detects a file that is too long.
  std::array<uint8_t, sizeof(display::TakeoverState) + 1> bytes{};
  const ssize_t size = pread(file, bytes.data(), bytes.size(), 0);
  if (size < 0) return std::nullopt;
  return display::parse_takeover_state(std::span(bytes.data(), static_cast<size_t>(size)));
}

/// Returns the output that a previous player left; null if there is none or its state is not valid.
/// Closes the other descriptors.
[[nodiscard]] inline std::shared_ptr<display::PreviousOutput> stored_output(
    std::vector<StoredDescriptor> descriptors) {
  auto output = std::make_shared<display::PreviousOutput>();
  std::optional<display::TakeoverState> state;
  for (StoredDescriptor& descriptor : descriptors) {
    if (descriptor.name == kCardName) output->card = std::move(descriptor.fd);
    if (descriptor.name == kStateName) state = read_state(descriptor.fd.get());
  }
  if (!output->card || !state) return nullptr;
  output->state = *state;
  return output;
}

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

[[nodiscard]] inline ProgressSample progress_sample(const PlayReport& report,
                                                    const display::KmsStatistics* kms) {
  StageDelays own = report.delays;
  if (own.source_waits_for_others) own.source = 0;
  ProgressSample sample{.flips = report.pace.shown,
                        .vblanks = report.wake.count,
                        .failures = report.flip_timeouts + report.busy,
                        .panel_away = report.off,
                        .stalled = !stalled_stage(own).empty()};
  if (kms == nullptr) return sample;
  sample.flips = kms->flips;
  sample.failures += kms->busy + kms->refused + kms->flip_timeouts;
  sample.panel_away |= kms->panel != display::PanelState::Showing;
  return sample;
}

/// Returns "EXACT yes; 600 frames shown, 0 underruns, 0 missed vblanks, panel showing; DP-1 on
/// ...".
[[nodiscard]] inline std::string status_text(const PlayReport& report,
                                             const display::KmsStatistics* kms,
                                             const display::ExactnessReport* exactness) {
  std::string text;
  if (exactness != nullptr) text = exactness->summary() + "; ";
  text += fmt::format("{} frames shown, {} underruns, {} missed vblanks", report.pace.shown,
                      report.pace.underruns, report.pace.missed);
  if (report.off) text += ", output off";
  if (kms != nullptr) text += fmt::format(", panel {}", panel_state_name(kms->panel));
  return text + "; " + report.display;
}

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
