// SPDX-License-Identifier: Apache-2.0
// VideoChild runs lenticule-video beside the player and reads its events.
#pragma once

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
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

/// VideoChild supervises a child process on its own thread: it starts, reads from, kills and reaps
/// the child, so that no other thread waits for it. The kernel kills the child when the thread that
/// started it ends, so that thread lives as long as this object. The functions below do not wait;
/// their lock is never held for long. Thread safety: one thread.
class VideoChild {
 public:
  VideoChild() : keeper_([this] { look_after(); }) {}
  /// Kills and reaps a running child.
  ~VideoChild() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      kill_ = true;
    }
    wanted_.notify_all();
    nudge_.signal();
    keeper_.join();
  }
  VideoChild(const VideoChild&) = delete;
  VideoChild& operator=(const VideoChild&) = delete;

  /// Starts the program arguments[0], with a descriptor if one is passed, which must stay open
  /// until take_end() has returned the end. The previous child must have ended and its end must
  /// have been taken.
  void start(std::vector<std::string> arguments, PassedDescriptor passed = {}) {
    LENTICULE_CHECK(!present_);
    present_ = true;
    broken_.store(0);
    clip_length_.store(0);
    {
      const std::lock_guard lock(mutex_);
      arguments_ = std::move(arguments);
      passed_ = passed;
      kill_ = false;
    }
    wanted_.notify_all();
  }
  void kill() {
    {
      const std::lock_guard lock(mutex_);
      kill_ = true;
    }
    nudge_.signal();
  }
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
  [[nodiscard]] pid_t pid() const {
    const std::lock_guard lock(mutex_);
    return pid_;
  }

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
  static constexpr int kPollMilliseconds = 200;
  void look_after() {
    while (true) {
      std::vector<std::string> arguments;
      {
        std::unique_lock lock(mutex_);
        wanted_.wait(lock, [this] { return stopping_ || !arguments_.empty(); });
        if (stopping_) return;
        arguments = std::exchange(arguments_, {});
        last_words_.clear();
      }
      keep(arguments);
    }
  }
  void keep(const std::vector<std::string>& arguments) {
    Pipe errors;
    Subprocess child;
    try {
      errors = make_pipe();
      std::vector<PassedDescriptor> passed = {{errors.writing.get(), STDERR_FILENO}};
      if (passed_.here >= 0) passed.push_back(passed_);
      child = Subprocess(arguments, passed);
    } catch (const Error& error) {
      report({.last_words = error.what()});
      return;
    }
    errors.writing.reset();
    {
      const std::lock_guard lock(mutex_);
      pid_ = child.pid();
    }
    listen(child, errors.reading.get());
    reap(std::move(child));
  }
  /// Reads events until the child's standard error is closed, at the latest when the child ends.
  void listen(const Subprocess& child, int errors) {
    std::string line;
    while (true) {
      std::array<pollfd, 2> streams{pollfd{errors, POLLIN, 0}, pollfd{nudge_.fd(), POLLIN, 0}};
      poll(streams.data(), streams.size(), kPollMilliseconds);
      nudge_.drain();
      {
        const std::lock_guard lock(mutex_);
        if (kill_) child.kill();
      }
      if (streams[0].revents != 0 && !read_some(errors, line)) break;
    }
    if (!line.empty()) hear(line);
  }
  [[nodiscard]] bool read_some(int errors, std::string& line) {
    std::array<char, kMostLine> buffer;
    const ssize_t n = read(errors, buffer.data(), buffer.size());
    if (n < 0) return errno == EINTR;
    for (const char c : std::string_view(buffer.data(), static_cast<size_t>(n))) {
      if (c == '\n') {
        hear(line);
        line.clear();
      } else if (line.size() < kMostLine) {
        line.push_back(c);
      }
    }
    return n > 0;
  }
  void hear(std::string_view line) {
    events_.fetch_add(1);
    const std::optional<VideoEvent> event = parse_video_event(line);
    const std::lock_guard lock(mutex_);
    if (!event) {
      // The first line that is not an event is the cause, later ones are the remedy.
      if (last_words_.empty()) last_words_ = escaped(line.substr(0, 500));
      return;
    }
    if (event->kind == VideoEvent::Kind::Position && event->time) position_ = event;
    if (event->kind == VideoEvent::Kind::Decoder) decoder_ = event;
    if (event->kind == VideoEvent::Kind::Broken) broken_.store(event->broken);
    if (event->kind != VideoEvent::Kind::Clip) return;
    missing_.fetch_add(event->missing);
    clip_length_.store(event->length);
  }
  /// Reaps the child. One that closed its standard error and still runs is out of control and is
  /// killed.
  void reap(Subprocess child) {
    const ProcessEnd how = child.end();
    ChildEnd end{.exit_code = how.exit_code, .signal = how.signal, .last_words = {}};
    {
      const std::lock_guard lock(mutex_);
      end.last_words = last_words_;
      pid_ = -1;
    }
    report(std::move(end));
  }
  void report(ChildEnd end) {
    {
      const std::lock_guard lock(mutex_);
      end_ = std::move(end);
    }
    ended_.signal();
  }

  WakeFd ended_;
  WakeFd nudge_;
  mutable std::mutex mutex_;
  std::condition_variable wanted_;
  PassedDescriptor passed_;             ///< beside standard error
  std::vector<std::string> arguments_;  ///< arguments of the child to start; empty = none requested
  std::optional<ChildEnd> end_;
  std::optional<VideoEvent> position_;
  std::optional<VideoEvent> decoder_;
  std::string last_words_;
  pid_t pid_ = -1;
  bool kill_ = false;
  bool stopping_ = false;
  bool present_ = false;  ///< the owner's view of the child's presence
  std::atomic<uint64_t> events_{0};
  std::atomic<uint64_t> broken_{0};
  std::atomic<uint64_t> missing_{0};
  std::atomic<uint64_t> clip_length_{0};
  std::thread keeper_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
