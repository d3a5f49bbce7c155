// SPDX-License-Identifier: Apache-2.0
#include "base/print.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <iterator>

#include "base/error_kinds.h"

namespace lenticule {
namespace {

constexpr int kTimeoutMilliseconds = 250;

std::atomic<uint64_t> g_dropped{0};
std::atomic<bool> g_stuck{false};  ///< true after standard error was not writable

/// Waits until standard error accepts PIPE_BUF bytes without blocking. If the last wait timed out,
/// only polls until standard error is writable again.
bool wait_for_standard_error() noexcept {
  pollfd error{STDERR_FILENO, POLLOUT, 0};
  int ready = 0;
  do {
    ready = poll(&error, 1, g_stuck ? 0 : kTimeoutMilliseconds);
  } while (ready < 0 && errno == EINTR);
  g_stuck = ready == 0;
  return ready != 0;
}

[[noreturn]] void cannot_write(int error) {
  throw failed_error("standard output: cannot write: {}", std::strerror(error != 0 ? error : EIO));
}

}  // namespace

namespace print_detail {

void write_diagnostic(std::string_view text) noexcept {
  while (!text.empty() && wait_for_standard_error()) {
    const ssize_t n = write(STDERR_FILENO, text.data(), std::min<size_t>(text.size(), PIPE_BUF));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    text.remove_prefix(static_cast<size_t>(n));
  }
  g_dropped += static_cast<uint64_t>(std::count(text.begin(), text.end(), '\n'));
}

void format_diagnostic(fmt::string_view format, fmt::format_args arguments) {
  fmt::memory_buffer text;
  fmt::vformat_to(std::back_inserter(text), format, arguments);
  write_diagnostic({text.data(), text.size()});
}

void format_result(fmt::string_view format, fmt::format_args arguments) {
  fmt::memory_buffer text;
  fmt::vformat_to(std::back_inserter(text), format, arguments);
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) cannot_write(errno);
}

void count_dropped_line() noexcept { ++g_dropped; }

}  // namespace print_detail

uint64_t dropped_log_lines() noexcept { return g_dropped; }

void flush_results() {
  errno = 0;
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) cannot_write(errno);
}

void finish_results() {
  flush_results();
  const int copy = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0);
  if (copy >= 0 && close(copy) != 0 && errno != EINTR) cannot_write(errno);
}

void prepare_standard_streams() noexcept {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(fd, F_GETFD) >= 0) continue;
    // open() returns the lowest free descriptor, which is `fd`.
    (void)!open("/dev/null", fd == STDOUT_FILENO ? O_RDONLY : O_RDWR);
  }
  std::signal(SIGPIPE, SIG_IGN);
}

}  // namespace lenticule
