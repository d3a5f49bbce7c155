// SPDX-License-Identifier: Apache-2.0
#include "player/process/raw_terminal.h"

#include <fmt/format.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace lenticule::player {
namespace {

// Written before g_fd is set, and never changed while it is.
termios g_before{};
std::atomic<int> g_fd{-1};

}  // namespace

RawTerminal::RawTerminal(int fd) {
  LENTICULE_CHECK(g_fd.load() < 0);
  termios raw{};
  if (tcgetattr(fd, &raw) != 0)
    throw Error(ErrorKind::Failed, fmt::format("terminal: {}", std::strerror(errno)),
                "give the keys in a file: --keys FILE");
  g_before = raw;
  g_fd.store(fd);
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  raw.c_iflag &= ~static_cast<tcflag_t>(IXON);
  raw.c_cc[VSUSP] = _POSIX_VDISABLE;
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  if (tcsetattr(fd, TCSANOW, &raw) == 0) return;
  const int error = errno;
  restore_terminal_now();
  throw Error(ErrorKind::Failed, fmt::format("terminal: {}", std::strerror(error)));
}

RawTerminal::~RawTerminal() {
  restore_terminal_now();
}

void restore_terminal_now() noexcept {
  const int fd = g_fd.exchange(-1);
  if (fd >= 0) (void)tcsetattr(fd, TCSANOW, &g_before);
}

}  // namespace lenticule::player
