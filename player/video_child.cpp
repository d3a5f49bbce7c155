// SPDX-License-Identifier: Apache-2.0
#include "player/video_child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/text.h"

extern char** environ;

namespace lenticule::player {
namespace {

constexpr size_t kMostLine = 4096;
constexpr int kPollMilliseconds = 200;

/// Dispositions and masks are not for others to inherit, and Ctrl-C is for us alone.
void set_signals(posix_spawnattr_t& attributes) {
  sigset_t none;
  sigset_t all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
}

/// 0, or why not. The child's input and output are /dev/null, its standard error is `errors`.
int spawn(const std::vector<std::string>& arguments, int errors, pid_t& pid) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  set_signals(attributes);
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const int error = posix_spawn(&pid, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

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

pid_t VideoChild::pid() const {
  const std::lock_guard lock(mutex_);
  return pid_;
}

std::optional<VideoEvent> VideoChild::position() const {
  const std::lock_guard lock(mutex_);
  return position_;
}

// --- the keeper's thread -----------------------------------------------------------------------

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
    error = spawn(arguments, pipe[1], pid);
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

/// Until the child's standard error is closed, which its end does if nothing else.
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
    // The first line of words is the cause, those after it are the remedy.
    if (last_words_.empty()) last_words_ = escaped(line.substr(0, 500));
    return;
  }
  if (event->kind == VideoEvent::Kind::Position && event->time) position_ = event;
  if (event->kind == VideoEvent::Kind::Broken) broken_.store(event->broken);
}

/// A child that closed its standard error and lives on is not one of ours any more.
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
