// SPDX-License-Identifier: Apache-2.0
#include "tests/support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>

namespace lenticule::test {
namespace {

using Clock = std::chrono::steady_clock;

struct Child {
  pid_t pid;
  int out;
  int err;
};

[[noreturn]] void become(const std::vector<std::string>& arguments,
                         const std::optional<uint64_t>& largest_file_bytes) {
  if (largest_file_bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{*largest_file_bytes, *largest_file_bytes};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  execv(argv[0], argv.data());
  _exit(127);
}

Child start(const std::vector<std::string>& arguments,
            const std::optional<uint64_t>& largest_file_bytes) {
  std::array<int, 2> out{};
  std::array<int, 2> err{};
  if (pipe2(out.data(), O_CLOEXEC) != 0 || pipe2(err.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("pipe2 failed");
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("fork failed");
  if (pid == 0) {
    const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
    dup2(null, STDIN_FILENO);
    dup2(out[1], STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    become(arguments, largest_file_bytes);
  }
  close(out[1]);
  close(err[1]);
  return {pid, out[0], err[0]};
}

/// Appends available output; returns false at the end of the stream.
bool drain(int fd, std::string& text) {
  std::array<char, 65536> buffer;
  const ssize_t n = read(fd, buffer.data(), buffer.size());
  if (n > 0) text.append(buffer.data(), static_cast<size_t>(n));
  return n > 0;
}

void read_until_end(const Child& child, const ProcessLimits& limits, ProcessResult& result) {
  const auto begin = Clock::now();
  bool interrupted = limits.interrupt_signal == 0;
  std::array<pollfd, 2> streams{pollfd{child.out, POLLIN, 0}, pollfd{child.err, POLLIN, 0}};
  while (streams[0].fd >= 0 || streams[1].fd >= 0) {
    const auto elapsed = Clock::now() - begin;
    if (!interrupted && elapsed >= limits.interrupt_after) {
      kill(child.pid, limits.interrupt_signal);
      interrupted = true;
    }
    if (elapsed >= limits.timeout && !result.timed_out) {
      result.timed_out = true;
      kill(child.pid, SIGKILL);
    }
    poll(streams.data(), streams.size(), 20);
    if (streams[0].fd >= 0 && streams[0].revents != 0 && !drain(child.out, result.out))
      streams[0].fd = -1;
    if (streams[1].fd >= 0 && streams[1].revents != 0 && !drain(child.err, result.err))
      streams[1].fd = -1;
  }
}

ProcessResult finish(const Child& child, const ProcessLimits& limits) {
  ProcessResult result;
  read_until_end(child, limits, result);
  close(child.out);
  close(child.err);
  int status = 0;
  waitpid(child.pid, &status, 0);
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  return result;
}

}  // namespace

ProcessResult run_process(const std::vector<std::string>& arguments, const ProcessLimits& limits) {
  return finish(start(arguments, limits.largest_file_bytes), limits);
}

BackgroundProcess::BackgroundProcess(const std::vector<std::string>& arguments) {
  const Child child = start(arguments, std::nullopt);
  pid_ = child.pid;
  out_ = child.out;
  err_ = child.err;
}

BackgroundProcess::~BackgroundProcess() {
  if (pid_ < 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  close(out_);
  close(err_);
}

void BackgroundProcess::signal(int number) const {
  if (pid_ > 0) kill(pid_, number);
}

ProcessResult BackgroundProcess::wait(std::chrono::seconds timeout) {
  const Child child{pid_, out_, err_};
  pid_ = -1;
  return finish(child, {.timeout = timeout});
}

}  // namespace lenticule::test
