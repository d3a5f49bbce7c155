// SPDX-License-Identifier: Apache-2.0
// VideoChild supervises a child process on its own thread: it starts, reads from, kills and reaps
// the child, so that no other thread waits for it.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/subprocess.h"
#include "base/wake_fd.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {

/// The exit state of a child.
struct ChildEnd {
  int exit_code = -1;  ///< -1 if a signal ended it or it could not be started
  int signal = 0;
  std::string last_words;  ///< the child's last message that was not an event; one printable line
  [[nodiscard]] std::string text() const;
};

/// The kernel kills the child when the thread that started it ends, so that thread lives as long as
/// this object. The functions below do not wait; their lock is never held for long. Thread safety:
/// one thread.
class VideoChild {
 public:
  VideoChild();
  /// Kills and reaps a running child.
  ~VideoChild();
  VideoChild(const VideoChild&) = delete;
  VideoChild& operator=(const VideoChild&) = delete;

  /// Starts the program arguments[0], passing "--parent PID" to its subcommand arguments[1]. The
  /// previous child must have ended and its end must have been taken.
  void start(std::vector<std::string> arguments);
  void kill();
  /// Returns once how the child ended; none while it runs and afterwards.
  [[nodiscard]] std::optional<ChildEnd> take_end();
  /// Returns true from start() until take_end() has returned the end.
  [[nodiscard]] bool present() const { return present_; }
  [[nodiscard]] pid_t pid() const;

  /// Returns the number of the child's events; it grows while the child works.
  [[nodiscard]] uint64_t events() const { return events_.load(); }
  /// Returns the child's latest position that has a time stamp.
  [[nodiscard]] std::optional<VideoEvent> position() const;
  /// Returns the number of frames and packets that the present child left out or found faulty.
  [[nodiscard]] uint64_t broken() const { return broken_.load(); }
  /// Returns the number of frames, over all rounds, that the clip claims to have and lacks.
  [[nodiscard]] uint64_t missing() const { return missing_.load(); }
  /// Returns the number of rounds of the clip that the present child has completed.
  [[nodiscard]] uint64_t rounds() const { return rounds_.load(); }
  /// Returns the latest report of which decoder is in use; none before the first report.
  [[nodiscard]] std::optional<VideoEvent> decoder() const;
  /// Returns a descriptor that is readable when the child has ended.
  [[nodiscard]] int wake_fd() const { return ended_.fd(); }

 private:
  void look_after();
  void keep(const std::vector<std::string>& arguments);
  void listen(const Subprocess& child, int errors);
  [[nodiscard]] bool read_some(int errors, std::string& line);
  void hear(std::string_view line);
  void reap(Subprocess child);
  void report(ChildEnd end);

  WakeFd ended_;
  WakeFd nudge_;
  mutable std::mutex mutex_;
  std::condition_variable wanted_;
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
  std::atomic<uint64_t> rounds_{0};
  std::thread keeper_;  // last member: the thread uses everything above
};

}  // namespace lenticule::player
