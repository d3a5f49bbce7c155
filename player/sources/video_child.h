// SPDX-License-Identifier: Apache-2.0
// VideoChild runs lenticule-video beside the player and reads its events.
#pragma once

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {

/// The exit state of a child.
struct ChildEnd {
  int exit_code = -1;  ///< -1 if a signal ended it or it could not be started
  int signal = 0;
  std::string last_words;  ///< the child's last message that was not an event; one printable line
  [[nodiscard]] std::string text() const {
    const std::string how = signal != 0 ? fmt::format("killed by signal {}", signal)
                                        : fmt::format("exit code {}", exit_code);
    return last_words.empty() ? how : fmt::format("{} ({})", last_words, how);
  }
};

/// VideoChild supervises a child process on a thread of its own: it starts, reads from, kills and
/// reaps the child, so that no other thread waits for it. The kernel kills the child when the
/// thread that started it ends, so that thread lives as long as the child. The functions below do
/// not wait; their lock is never held for long. Thread safety: one thread.
class VideoChild {
 public:
  VideoChild() = default;
  /// Kills and reaps a running child.
  ~VideoChild() { kill(); }

  /// Starts the program arguments[0], with a descriptor if one is passed, which must stay open
  /// until take_end() has returned the end. The previous child must have ended and its end must
  /// have been taken.
  void start(std::vector<std::string> arguments, PassedDescriptor passed = {}) {
    LENTICULE_CHECK(!present_);
    present_ = true;
    broken_.store(0);
    clip_length_.store(0);
    if (keeper_.joinable()) keeper_.join();
    killed_.drain();
    try {
      keeper_ = std::jthread([this, words = std::move(arguments), passed] { keep(words, passed); });
    } catch (const std::system_error& error) {
      report({.last_words = error.what()});
    }
  }
  void kill() { killed_.signal(); }
  /// Returns once how the child ended; none while it runs and afterwards.
  [[nodiscard]] std::optional<ChildEnd> take_end() {
    const std::lock_guard lock(mutex_);
    if (!end_) return std::nullopt;
    ended_.drain();
    present_ = false;
    return std::exchange(end_, std::nullopt);
  }
  /// Returns true from start() until take_end() has returned the end.
  [[nodiscard]] bool present() const { return present_; }
  [[nodiscard]] pid_t pid() const { return pid_.load(); }

  /// Returns the number of the child's events; it grows while the child works.
  [[nodiscard]] uint64_t events() const { return events_.load(); }
  /// Returns the child's latest position that has a time stamp.
  [[nodiscard]] std::optional<VideoEvent> position() const {
    const std::lock_guard lock(mutex_);
    return position_;
  }
  /// Returns the number of frames and packets that the present child left out or found faulty.
  [[nodiscard]] uint64_t broken() const { return broken_.load(); }
  /// Returns the number of frames, over all rounds, that the clip claims to have and lacks.
  [[nodiscard]] uint64_t missing() const { return missing_.load(); }
  /// Returns the length of the clip; 0 until the present child has completed a round of it.
  [[nodiscard]] uint64_t clip_length() const { return clip_length_.load(); }
  /// Returns the latest report of which decoder is in use; none before the first report.
  [[nodiscard]] std::optional<VideoEvent> decoder() const {
    const std::lock_guard lock(mutex_);
    return decoder_;
  }
  /// Returns a descriptor that is readable when the child has ended.
  [[nodiscard]] int wake_fd() const { return ended_.fd(); }

 private:
  static constexpr size_t kMostLine = 4096;
  void keep(const std::vector<std::string>& arguments, PassedDescriptor passed) {
    ChildEnd end;
    try {
      Pipe errors = make_pipe();
      std::vector<PassedDescriptor> all = {{errors.writing.get(), STDERR_FILENO}};
      if (passed.here >= 0) all.push_back(passed);
      Subprocess child(arguments, all);
      errors.writing.reset();
      pid_.store(child.pid());
      listen(errors.reading.get(), end.last_words);
      // A child that closed its standard error and still runs is out of control, and is killed.
      const ProcessEnd how = child.end();
      end.exit_code = how.exit_code;
      end.signal = how.signal;
    } catch (const Error& error) {
      end.last_words = error.what();
    }
    pid_.store(-1);
    report(std::move(end));
  }
  /// Reads events until the child's standard error is closed, or the child is to be killed.
  void listen(int errors, std::string& last_words) {
    std::string line;
    for (bool open = true; open;) {
      std::array<pollfd, 2> streams{pollfd{errors, POLLIN, 0}, pollfd{killed_.fd(), POLLIN, 0}};
      (void)poll(streams.data(), streams.size(), -1);
      if (streams[1].revents != 0) break;
      std::array<char, kMostLine> buffer;
      const ssize_t n = streams[0].revents != 0 ? read(errors, buffer.data(), buffer.size()) : -1;
      open = n > 0 || (n < 0 && errno == EINTR);
      for (const char c :
           std::string_view(buffer.data(), static_cast<size_t>(std::max<ssize_t>(n, 0)))) {
        if (c != '\n' && line.size() < kMostLine) line.push_back(c);
        if (c == '\n') hear(std::exchange(line, {}), last_words);
      }
    }
    if (!line.empty()) hear(line, last_words);
  }
  void hear(std::string_view line, std::string& last_words) {
    events_.fetch_add(1);
    const std::optional<VideoEvent> event = parse_video_event(line);
    // The first line that is not an event is the cause, later ones are the remedy.
    if (!event && last_words.empty()) last_words = escaped(line.substr(0, 500));
    if (!event) return;
    const std::lock_guard lock(mutex_);
    if (event->kind == VideoEvent::Kind::Position && event->time) position_ = event;
    if (event->kind == VideoEvent::Kind::Decoder) decoder_ = event;
    if (event->kind == VideoEvent::Kind::Broken) broken_.store(event->broken);
    if (event->kind != VideoEvent::Kind::Clip) return;
    missing_.fetch_add(event->missing);
    clip_length_.store(event->length);
  }
  void report(ChildEnd end) {
    const std::lock_guard lock(mutex_);
    end_ = std::move(end);
    ended_.signal();
  }

  WakeFd ended_, killed_;
  mutable std::mutex mutex_;
  std::optional<ChildEnd> end_;
  std::optional<VideoEvent> position_;
  std::optional<VideoEvent> decoder_;
  bool present_ = false;  ///< the owner's view of the child's presence
  std::atomic<pid_t> pid_{-1};
  std::atomic<uint64_t> events_{0};
  std::atomic<uint64_t> broken_{0};
  std::atomic<uint64_t> missing_{0};
  std::atomic<uint64_t> clip_length_{0};
  std::jthread keeper_;
};

}  // namespace lenticule::player
