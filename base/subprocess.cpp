// SPDX-License-Identifier: Apache-2.0
#include "base/subprocess.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "base/error_kinds.h"

extern char** environ;

namespace lenticule {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr auto kKillTimeout = 5s;
constexpr milliseconds kLook = 50ms;  ///< pause between two looks at the limit
constexpr size_t kMostOutput = size_t{4} << 20;

/// Spawn prepares the descriptors and the signals of the new process.
class Spawn {
 public:
  explicit Spawn(const std::vector<PassedDescriptor>& passed) {
    posix_spawn_file_actions_init(&actions_);
    int highest = STDERR_FILENO;
    for (const PassedDescriptor& one : passed) highest = std::max(highest, one.there);
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
      posix_spawn_file_actions_addopen(&actions_, stream, "/dev/null", O_RDWR, 0);
    for (const PassedDescriptor& one : passed)
      posix_spawn_file_actions_adddup2(&actions_, above(one.here, highest), one.there);
    posix_spawn_file_actions_addclosefrom_np(&actions_, highest + 1);
    sigset_t none;
    sigset_t all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_init(&attributes_);
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setsigdefault(&attributes_, &all);
    posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~Spawn() {
    posix_spawnattr_destroy(&attributes_);
    posix_spawn_file_actions_destroy(&actions_);
  }
  Spawn(const Spawn&) = delete;
  Spawn& operator=(const Spawn&) = delete;

  /// Starts the program; returns 0 or an errno.
  int start(pid_t& pid, char* const* arguments) const {
    return posix_spawn(&pid, arguments[0], &actions_, &attributes_, arguments, environ);
  }

 private:
  /// Returns the descriptor or a copy with a higher number than any that an earlier action
  /// replaces.
  int above(int fd, int highest) {
    if (fd > highest || fd < 0) return fd;
    copies_.emplace_back(fcntl(fd, F_DUPFD_CLOEXEC, highest + 1));
    return copies_.back().get();
  }

  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
  std::vector<UniqueFd> copies_;
};

/// Returns 0 once the time is over.
int milliseconds_until(Clock::time_point deadline, milliseconds most) {
  const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now());
  return static_cast<int>(std::clamp(left, 0ms, most).count());
}

bool is_readable(int fd, milliseconds timeout) {
  pollfd stream{.fd = fd, .events = POLLIN, .revents = 0};
  return poll(&stream, 1, static_cast<int>(timeout.count())) > 0;
}

/// Reads the available output; returns false at its end.
bool drain(int fd, std::string& text) {
  std::array<char, 65536> buffer;
  const ssize_t n = read(fd, buffer.data(), buffer.size());
  if (n < 0) return errno == EINTR || errno == EAGAIN;
  text.append(buffer.data(), static_cast<size_t>(n));
  if (text.size() > 2 * kMostOutput) text.erase(0, text.size() - kMostOutput);
  return n > 0;
}

}  // namespace

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    throw failed_error("cannot create a pipe: {}", std::strerror(errno))
        .remedy("raise the limit of open files");
  return {UniqueFd(ends[0]), UniqueFd(ends[1])};
}

Subprocess::Subprocess(const std::vector<std::string>& arguments,
                       const std::vector<PassedDescriptor>& passed) {
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t pid = -1;
  if (const int error = Spawn(passed).start(pid, argv.data()))
    throw failed_error("{}: cannot start: {}", arguments[0], std::strerror(error));
  pid_ = pid;
}

void Subprocess::kill() const noexcept {
  if (pid_ <= 0) return;
  ::kill(-pid_, SIGKILL);
  ::kill(pid_, SIGKILL);  // in case it left its group
}

std::optional<ProcessEnd> Subprocess::wait_until(Clock::time_point deadline) noexcept {
  if (pid_ <= 0) return ProcessEnd{};
  const UniqueFd ended(static_cast<int>(syscall(SYS_pidfd_open, pid_, 0)));
  while (true) {
    int status = 0;
    const pid_t reaped = waitpid(pid_, &status, WNOHANG);
    if (reaped == pid_ || (reaped < 0 && errno != EINTR)) {
      pid_ = -1;
      if (reaped > 0 && WIFEXITED(status)) return ProcessEnd{.exit_code = WEXITSTATUS(status)};
      return ProcessEnd{.signal = reaped > 0 && WIFSIGNALED(status) ? WTERMSIG(status) : 0};
    }
    if (Clock::now() >= deadline) return std::nullopt;
    // Without a descriptor of the process, the call only pauses.
    pollfd query{.fd = ended.get(), .events = POLLIN, .revents = 0};
    (void)poll(&query, 1, milliseconds_until(deadline, ended ? 1000ms : 5ms));
  }
}

ProcessEnd Subprocess::end() noexcept {
  if (const auto ended = wait_until(Clock::time_point::min())) return *ended;
  kill();
  const auto ended = wait_until(Clock::now() + kKillTimeout);
  pid_ = -1;
  return ended.value_or(ProcessEnd{.signal = SIGKILL});
}

ProgramRun run_and_capture(const std::vector<std::string>& arguments, milliseconds limit,
                           const std::function<bool()>& stops) {
  const Clock::time_point begin = Clock::now();
  Pipe pipe = make_pipe();
  Subprocess program(arguments,
                     {{pipe.writing.get(), STDOUT_FILENO}, {pipe.writing.get(), STDERR_FILENO}});
  pipe.writing.reset();
  ProgramRun run;
  const int output = pipe.reading.get();
  bool open = true;
  while (program) {
    if (open && is_readable(output, kLook)) {
      open = drain(output, run.output);
    } else if (const auto ended = open ? std::nullopt : program.wait_until(Clock::now() + kLook)) {
      run.exit_code = ended->exit_code;
      break;
    }
    run.timed_out = Clock::now() - begin >= limit;
    if (!run.timed_out && !stops()) continue;
    program.kill();  // also its descendants, if it has ended itself
    run.exit_code = program.end().exit_code;
    if (open && is_readable(output, 0ms)) (void)drain(output, run.output);  // a full pipe at most
  }
  run.wall_seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return run;
}

}  // namespace lenticule
