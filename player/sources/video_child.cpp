// SPDX-License-Identifier: Apache-2.0
#include "player/sources/video_child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "player/process/spawn_program.h"

namespace lenticule::player {
namespace {

constexpr size_t kMostLine = 4096;
constexpr int kPollMilliseconds = 200;

}  // namespace

std::string ChildEnd::text() const {
  const std::string how = signal != 0 ? fmt::format("killed by signal {}", signal)
                                      : fmt::format("exit code {}", exit_code);
  return last_words.empty() ? how : fmt::format("{} ({})", last_words, how);
}

VideoChild::VideoChild() : keeper_([this] { look_after(); }) {}

VideoChild::~VideoChild() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    kill_ = true;
  }
  wanted_.notify_all();
  nudge_.signal();
  keeper_.join();
}

void VideoChild::start(std::vector<std::string> arguments) {
  LENTICULE_CHECK(!present_ && arguments.size() >= 2);
  present_ = true;
  broken_.store(0);
  rounds_.store(0);
  arguments.insert(arguments.begin() + 2, {"--parent", std::to_string(getpid())});
  {
    const std::lock_guard lock(mutex_);
    arguments_ = std::move(arguments);
    kill_ = false;
  }
  wanted_.notify_all();
}

void VideoChild::kill() {
  {
    const std::lock_guard lock(mutex_);
    kill_ = true;
  }
  nudge_.signal();
}

std::optional<ChildEnd> VideoChild::take_end() {
  const std::lock_guard lock(mutex_);
  if (!end_) return std::nullopt;
  ended_.drain();
  present_ = false;
  return std::exchange(end_, std::nullopt);
}

void VideoChild::expect_frames(std::optional<uint64_t> expected) {
  const std::lock_guard lock(mutex_);
  expected_ = expected;
}

pid_t VideoChild::pid() const {
  const std::lock_guard lock(mutex_);
  return pid_;
}

std::optional<VideoEvent> VideoChild::position() const {
  const std::lock_guard lock(mutex_);
  return position_;
}

// --- the keeper thread -------------------------------------------------------------------------

void VideoChild::look_after() {
  while (true) {
    std::vector<std::string> arguments;
    {
      std::unique_lock lock(mutex_);
      wanted_.wait(lock, [this] { return stopping_ || !arguments_.empty(); });
      if (stopping_) return;
      arguments = std::exchange(arguments_, {});
      last_words_.clear();
    }
    int errors = -1;
    if (!launch(arguments, errors)) continue;
    listen(errors);
    close(errors);
    reap();
  }
}

bool VideoChild::launch(const std::vector<std::string>& arguments, int& errors) {
  std::array<int, 2> pipe{};
  int error = pipe2(pipe.data(), O_CLOEXEC) == 0 ? 0 : errno;
  pid_t pid = -1;
  if (error == 0) {
    error = spawn_program(arguments, {{pipe[1], STDERR_FILENO}}, pid);
    close(pipe[1]);
    if (error != 0) close(pipe[0]);
  }
  if (error != 0) {
    report({.last_words =
                fmt::format("{}: cannot be started: {}", arguments[0], std::strerror(error))});
    return false;
  }
  const std::lock_guard lock(mutex_);
  pid_ = pid;
  errors = pipe[0];
  return true;
}

/// Reads events until the child's standard error is closed, at the latest when the child ends.
void VideoChild::listen(int errors) {
  std::string line;
  while (true) {
    std::array<pollfd, 2> streams{pollfd{errors, POLLIN, 0}, pollfd{nudge_.fd(), POLLIN, 0}};
    poll(streams.data(), streams.size(), kPollMilliseconds);
    nudge_.drain();
    {
      const std::lock_guard lock(mutex_);
      if (kill_) ::kill(pid_, SIGKILL);
    }
    if (streams[0].revents != 0 && !read_some(errors, line)) break;
  }
  if (!line.empty()) hear(line);
}

bool VideoChild::read_some(int errors, std::string& line) {
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

void VideoChild::hear(std::string_view line) {
  events_.fetch_add(1);
  const std::optional<VideoEvent> event = parse_video_event(line);
  const std::lock_guard lock(mutex_);
  if (!event) {
    // The first line that is not an event is the cause, later ones are the remedy.
    if (last_words_.empty()) last_words_ = escaped(line.substr(0, 500));
    return;
  }
  if (event->kind == VideoEvent::Kind::Position && event->time) position_ = event;
  if (event->kind == VideoEvent::Kind::Broken) broken_.store(event->broken);
  const uint64_t known = event->frame + event->left_out;
  if (event->kind != VideoEvent::Kind::Clip) return;
  if (expected_ && known < *expected_) missing_.fetch_add(*expected_ - known);
  rounds_.fetch_add(1);
}

/// Reaps the child. One that closed its standard error and still runs is out of control and is
/// killed.
void VideoChild::reap() {
  ::kill(pid_, SIGKILL);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  ChildEnd end;
  {
    const std::lock_guard lock(mutex_);
    end.last_words = last_words_;
    pid_ = -1;
  }
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  report(std::move(end));
}

void VideoChild::report(ChildEnd end) {
  {
    const std::lock_guard lock(mutex_);
    end_ = std::move(end);
  }
  ended_.signal();
}

}  // namespace lenticule::player
