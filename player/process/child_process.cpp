// SPDX-License-Identifier: Apache-2.0
#include "player/process/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "base/error.h"
#include "player/process/interrupt.h"

extern char** environ;

namespace lenticule::player {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kMostOutput = size_t{4} << 20;
constexpr int kPollMilliseconds = 50;

struct Child {
  pid_t pid = -1;
  int output = -1;
};

[[noreturn]] void cannot_start(const std::string& program, int error) {
  throw Error(ErrorKind::Failed,
              fmt::format("{}: cannot be started: {}", program, std::strerror(error)));
}

Child start(const std::vector<std::string>& arguments) {
  std::array<int, 2> pipe{};
  if (pipe2(pipe.data(), O_CLOEXEC) != 0) cannot_start(arguments[0], errno);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, pipe[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, pipe[1], STDERR_FILENO);
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  Child child{.output = pipe[0]};
  const int error = posix_spawn(&child.pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(pipe[1]);
  if (error != 0) {
    close(pipe[0]);
    cannot_start(arguments[0], error);
  }
  return child;
}

/// Appends the available output; returns false at the end of the stream.
bool drain(int fd, std::string& text) {
  std::array<char, 65536> buffer;
  const ssize_t n = read(fd, buffer.data(), buffer.size());
  if (n < 0) return errno == EINTR || errno == EAGAIN;
  text.append(buffer.data(), static_cast<size_t>(n));
  if (text.size() > 2 * kMostOutput) text.erase(0, text.size() - kMostOutput);
  return n > 0;
}

}  // namespace

ChildResult run_child(const std::vector<std::string>& arguments, std::chrono::seconds limit) {
  const Clock::time_point begin = Clock::now();
  const Child child = start(arguments);
  ChildResult result;
  bool killed = false;
  while (true) {
    pollfd stream{.fd = child.output, .events = POLLIN, .revents = 0};
    poll(&stream, 1, kPollMilliseconds);
    if (stream.revents != 0 && !drain(child.output, result.output)) break;
    const bool late = Clock::now() - begin >= limit;
    if (killed || (!late && !interrupted())) continue;
    killed = true;
    result.timed_out = late;
    kill(child.pid, SIGKILL);
  }
  close(child.output);
  int status = 0;
  while (waitpid(child.pid, &status, 0) < 0 && errno == EINTR) {
  }
  result.wall_seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  return result;
}

std::optional<std::string> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(':'), rest.size());
    const auto file = std::filesystem::path(rest.substr(0, end)) / name;
    if (end > 0 && access(file.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(file))
      return file.string();
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return std::nullopt;
}

}  // namespace lenticule::player
