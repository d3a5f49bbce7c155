// SPDX-License-Identifier: Apache-2.0
// A child process that is looked after by a thread of its own: started, listened to, killed,
// reaped. Nobody else ever waits for it.
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

#include "base/wake_fd.h"
#include "player/sources/video_probe.h"

namespace lenticule::player {

/// How a child ended.
struct ChildEnd {
  int exit_code = -1;  ///< -1 when a signal ended it or it could not be started
  int signal = 0;
  std::string last_words;  ///< what it last said that was no event; one line, printable
  [[nodiscard]] std::string text() const;
};

/// The kernel kills the child when the thread that started it ends, which is why that thread lives
/// as long as this object. The calls below come from one thread, take a lock that is never held for
/// long, and do not wait.
class VideoChild {
 public:
  VideoChild();
  /// Kills a child that runs, and reaps it.
  ~VideoChild();
  VideoChild(const VideoChild&) = delete;
  VideoChild& operator=(const VideoChild&) = delete;

  /// Starts the program arguments[0], whose subcommand arguments[1] is told "--parent PID". The
  /// child before must have ended and been told.
  void start(std::vector<std::string> arguments);
  void kill();
  /// How it ended, once: nullopt while it runs, and after it was told.
  [[nodiscard]] std::optional<ChildEnd> take_end();
  /// True from start() to the moment that take_end() has told the end.
  [[nodiscard]] bool present() const { return present_; }
  [[nodiscard]] pid_t pid() const;

  /// Counts what it says: moves while it works.
  [[nodiscard]] uint64_t events() const { return events_.load(); }
  /// Its latest position with a time stamp.
  [[nodiscard]] std::optional<VideoEvent> position() const;
  /// Frames and packets that the present child left out, or found faulty.
  [[nodiscard]] uint64_t broken() const { return broken_.load(); }
  /// Frames that are not in the clip though it should have `expected` of them: of all rounds.
  [[nodiscard]] uint64_t missing() const { return missing_.load(); }
  /// Rounds of the clip that the present child has come to the end of.
  [[nodiscard]] uint64_t rounds() const { return rounds_.load(); }
  void expect_frames(std::optional<uint64_t> expected);
  /// Readable when the child has ended.
  [[nodiscard]] int wake_fd() const { return ended_.fd(); }

 private:
  void look_after();
  [[nodiscard]] bool launch(const std::vector<std::string>& arguments, int& errors);
  void listen(int errors);
  [[nodiscard]] bool read_some(int errors, std::string& line);
  void hear(std::string_view line);
  void reap();
  void report(ChildEnd end);

  WakeFd ended_;
  WakeFd nudge_;
  mutable std::mutex mutex_;
  std::condition_variable wanted_;
  std::vector<std::string> arguments_;  ///< of the child to start; empty = none wanted
  std::optional<ChildEnd> end_;
  std::optional<VideoEvent> position_;
  std::string last_words_;
  pid_t pid_ = -1;
  bool kill_ = false;
  bool stopping_ = false;
  bool present_ = false;  ///< the owner's view
  std::atomic<uint64_t> events_{0};
  std::atomic<uint64_t> broken_{0};
  std::atomic<uint64_t> missing_{0};
  std::atomic<uint64_t> rounds_{0};
  std::optional<uint64_t> expected_;  ///< under the mutex
  std::thread keeper_;                // last: uses everything above
};

}  // namespace lenticule::player
